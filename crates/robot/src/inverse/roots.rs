//! Roots of a function of one angle, which has no value everywhere.

/// A root between two angles, at the first of which the value is `first`.
pub(super) fn bisect(value: impl Fn(f64) -> f64, [mut from, mut to]: [f64; 2], first: f64) -> f64 {
    for _ in 0..10 {
        let middle = 0.5 * (from + to);
        let found = value(middle);
        if found * first > 0.0 || found.is_nan() {
            from = middle;
        } else {
            to = middle;
        }
    }
    0.5 * (from + to)
}

/// The last angle from one with a value towards one without that has one, and its value.
pub(super) fn edge(value: impl Fn(f64) -> f64, [mut with, mut without]: [f64; 2]) -> (f64, f64) {
    for _ in 0..16 {
        let middle = 0.5 * (with + without);
        match value(middle).is_nan() {
            true => without = middle,
            false => with = middle,
        }
    }
    (with, value(with))
}

/// Where a value of one sign comes nearest to 0, or passes it, between two angles (golden section).
pub(super) fn lowest(
    value: impl Fn(f64) -> f64,
    [mut from, mut to]: [f64; 2],
    sign: f64,
) -> (f64, f64) {
    let height = |q: f64| {
        let found = sign * value(q);
        if found.is_nan() { f64::INFINITY } else { found }
    };
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let (mut a, mut b) = (to - golden * (to - from), from + golden * (to - from));
    let (mut at_a, mut at_b) = (height(a), height(b));
    for _ in 0..12 {
        if at_a < at_b {
            (to, b, at_b) = (b, a, at_a);
            a = to - golden * (to - from);
            at_a = height(a);
        } else {
            (from, a, at_a) = (a, b, at_b);
            b = from + golden * (to - from);
            at_b = height(b);
        }
        if at_a.min(at_b) < 0.0 {
            break;
        }
    }
    let best = if at_a < at_b { a } else { b };
    (best, sign * at_a.min(at_b))
}
