//! Numbers and words as controllers read them.

use super::ProgramError;
use crate::arm::Joints;
use crate::place::Pose;

/// A number with at most so many decimals, without an exponent, trailing zeros or a sign on zero.
pub(super) fn number(x: f64, decimals: usize) -> String {
    let text = format!("{x:.decimals$}");
    let text = match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.'),
        false => &text,
    };
    match text {
        "-0" => "0".into(),
        text => text.into(),
    }
}

/// Joints in degrees.
pub(super) fn angles(joints: &Joints) -> Joints {
    joints.map(f64::to_degrees)
}

/// What a controller shows of a text: printable ASCII on one line.
pub(super) fn ascii(text: &str) -> String {
    let plain = |c: char| {
        if c.is_ascii_graphic() || c == ' ' {
            c
        } else {
            '_'
        }
    };
    text.chars().map(plain).take(60).collect()
}

/// A frame whose numbers are finite.
pub(super) fn finite(pose: &Pose, what: &'static str) -> Result<Pose, ProgramError> {
    match pose.to_homogeneous().iter().all(|x| x.is_finite()) {
        true => Ok(*pose),
        false => Err(ProgramError::NotFinite { what }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_without_a_sign_on_zero() {
        let all = [
            (1.0, "1"),
            (-1e-17, "0"),
            (0.12345, "0.123"),
            (-12.5, "-12.5"),
            (1e6, "1000000"),
            (100.0, "100"),
        ];
        for (x, expected) in all {
            assert_eq!(number(x, 3), expected);
        }
        assert_eq!(number(100.0, 0), "100");
    }
}
