use std::path::Path;

use drape_cloth::file::{ReadError, read_text};

use crate::columns::{CsvColumn, TESTS, Test};
use crate::curve::Sample;

/// What standard tests have measured. First warp or positive, then weft or negative.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lab {
    /// Overhangs of cantilevers at 41.5 degrees [m].
    pub overhang: [Vec<f64>; 2],
    pub tension: [Vec<Specimen>; 2],
    pub shear: [Vec<Specimen>; 2],
    /// Static and dynamic coefficients of warp and of weft.
    pub friction: [[Vec<f64>; 2]; 2],
    /// [kg/m²]
    pub areal_mass: Vec<f64>,
    /// [m]
    pub thickness: Vec<f64>,
}

/// The curve that one specimen gave.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Specimen {
    /// Strain or angle [rad], and stress [Pa] or force per width [N/m].
    pub samples: Vec<Sample>,
    /// Values are forces per width, stresses times the thickness.
    pub is_per_width: bool,
}

/// A row of a test in SI.
struct Row {
    line: usize,
    /// In the order of the test's columns.
    values: Vec<f64>,
    direction: Option<usize>,
    specimen: String,
}

impl Lab {
    /// Adds the test in a CSV file. Its header names quantities and units, and by them the test; `direction` and
    /// `specimen` tell rows apart. Where it is separated by semicolons, commas are decimal.
    ///
    /// # Errors
    /// Names the file, the line and what was expected, of anything that is no such test.
    pub fn read(&mut self, path: &Path) -> Result<(), ReadError> {
        let text = read_text(path)?;
        let found = rows(&text).and_then(|(test, columns, rows)| self.add(test, &columns, rows));
        found.map_err(|fault| ReadError::fault(path, fault))
    }

    fn add(&mut self, test: Test, columns: &[CsvColumn], rows: Vec<Row>) -> Result<(), String> {
        // Specimens of this file, on either side.
        let mut names: [Vec<String>; 2] = Default::default();
        for row in rows {
            let at = |column| columns.iter().position(|&known| known == column);
            let of = |column| at(column).map(|place| row.values[place]);
            let sides = match row.direction {
                Some(side) => side..side + 1,
                None => 0..2,
            };
            if test == Test::Sheet {
                self.areal_mass.extend(of(CsvColumn::ArealMass));
                self.thickness.extend(of(CsvColumn::Thickness));
                continue;
            }
            for side in sides {
                match test {
                    Test::Cantilever => self.overhang[side].extend(of(CsvColumn::Overhang)),
                    Test::Friction => {
                        let [resting, sliding] = friction(of);
                        self.friction[side][0].extend(resting);
                        self.friction[side][1].extend(sliding);
                    }
                    _ => {
                        let sample = sample(test, of).map_err(|fault| row.at(&fault))?;
                        let curves = match test {
                            Test::Tension => &mut self.tension[side],
                            _ => &mut self.shear[side],
                        };
                        let names = &mut names[side];
                        let known = names.iter().position(|name| *name == row.specimen);
                        if known.is_none() {
                            names.push(row.specimen.clone());
                            curves.push(Specimen {
                                samples: Vec::new(),
                                is_per_width: of(CsvColumn::Stress).is_none(),
                            });
                        }
                        let first = curves.len() - names.len();
                        let number = known.unwrap_or(names.len() - 1);
                        curves[first + number].samples.push(sample);
                    }
                }
            }
        }
        Ok(())
    }
}

impl Row {
    fn at(&self, fault: &str) -> String {
        format!("line {}: {fault}", self.line)
    }
}

/// Static and dynamic coefficient, as far as they were measured.
fn friction(of: impl Fn(CsvColumn) -> Option<f64>) -> [Option<f64>; 2] {
    use CsvColumn::*;
    [
        (StaticFriction, StaticAngle, StaticForce),
        (DynamicFriction, DynamicAngle, DynamicForce),
    ]
    .map(|(coefficient, angle, force)| {
        let pulled = || Some(of(force)? / of(NormalForce)?);
        of(coefficient).or(of(angle).map(f64::tan)).or_else(pulled)
    })
}

/// What a row says of the curve.
fn sample(test: Test, of: impl Fn(CsvColumn) -> Option<f64>) -> Result<Sample, String> {
    use CsvColumn::*;
    let the = |column| of(column).expect("a column of the test");
    let stress = || of(Stress).or(of(LineForce)).expect("a column of the test");
    Ok(match test {
        Test::Tension => Sample::new(the(Strain), stress()),
        // Work is done by the moment, which is the force along a side times the distance of both sides.
        Test::Shear if of(Stress).is_none() => Sample::new(the(Angle), stress() * the(Angle).cos()),
        Test::Shear => Sample::new(the(Angle), stress()),
        _ => {
            let [d, f, h, w] = [Displacement, Force, Length, Width].map(the);
            if h < 2.0 * w {
                return Err(format!(
                    "length is {h} m and width {w} m, expected a length of at least twice the width"
                ));
            }
            let stretch = 1.0 + d / (h - w);
            let cos = stretch / 2f64.sqrt();
            if cos >= 1.0 {
                return Err(format!(
                    "displacement is {d} m, expected less than {:.4}, where yarns lie along the load",
                    (2f64.sqrt() - 1.0) * (h - w)
                ));
            }
            let angle = std::f64::consts::FRAC_PI_2 - 2.0 * cos.acos();
            let (sin, cos) = (0.5 * angle).sin_cos();
            // The load's work goes into W (2H - 3W) / 2 of the strip that is sheared by the angle, and into W²
            // that is sheared by half of it.
            Sample {
                at: angle,
                half: w / (2.0 * h - 3.0 * w),
                value: f * (h / w - 1.0) * (cos - sin) / (2.0 * h - 3.0 * w),
            }
        }
    })
}

/// Test, columns in their order, and rows.
fn rows(text: &str) -> Result<(Test, Vec<CsvColumn>, Vec<Row>), String> {
    let lines = text.lines().map(str::trim).enumerate();
    let mut lines = lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let (top, first) = lines.next().ok_or("is empty, expected a header and rows")?;
    let top = top + 1;
    let is_semicolon = first.contains(';');
    let header = cells(first, is_semicolon);
    let (mut direction, mut specimen) = (None, None);
    let mut places: Vec<(CsvColumn, usize, f64)> = Vec::new();
    for (place, name) in header.iter().enumerate() {
        let number = place + 1;
        match *name {
            "direction" if direction.is_none() => direction = Some(place),
            "specimen" if specimen.is_none() => specimen = Some(place),
            _ => {
                let (column, factor) = CsvColumn::named(name).map_err(|expected| {
                    format!("line {top}: column {number} is \"{name}\", expected {expected}")
                })?;
                if places.iter().any(|&(known, ..)| known == column) {
                    return Err(format!(
                        "line {top}: column {number}, \"{name}\", says again what another says"
                    ));
                }
                places.push((column, place, factor));
            }
        }
    }
    places.sort_by_key(|&(column, ..)| column);
    let columns: Vec<CsvColumn> = places.iter().map(|&(column, ..)| column).collect();
    let test = Test::of(&columns).ok_or_else(|| {
        format!(
            "line {top}: columns are {}, expected {TESTS}",
            header.join(", ")
        )
    })?;
    let (directions, is_required) = test.directions();
    if is_required && direction.is_none() {
        let [a, b] = directions;
        return Err(format!(
            "line {top}: there is no column `direction`, expected one that says {a} or {b}"
        ));
    }
    let mut rows = Vec::new();
    for (number, line) in lines {
        let (line, record) = (number + 1, cells(line, is_semicolon));
        let (found, expected) = (record.len(), header.len());
        if found != expected {
            return Err(format!(
                "line {line}: has {found} columns, expected {expected} as in the header"
            ));
        }
        let number = |&(column, place, factor): &(CsvColumn, usize, f64)| {
            let found = record[place];
            let text = match is_semicolon {
                true => found.replace(',', "."),
                false => found.into(),
            };
            let value = text.parse().map(|value: f64| value * factor);
            let value = value.ok().filter(|&value| column.is_valid(value));
            value.ok_or_else(|| {
                let (name, expected) = (header[place], column.expected(factor));
                format!("line {line}: `{name}` is \"{found}\", expected {expected}")
            })
        };
        rows.push(Row {
            line,
            values: places.iter().map(number).collect::<Result<_, _>>()?,
            direction: direction
                .map(|place| side(&record, place, directions, line))
                .transpose()?,
            specimen: specimen.map_or(String::new(), |place| record[place].into()),
        });
    }
    match rows.is_empty() {
        true => Err("has a header and no rows, expected one or more".into()),
        false => Ok((test, columns, rows)),
    }
}

fn side(
    record: &[&str],
    place: usize,
    directions: [&str; 2],
    line: usize,
) -> Result<usize, String> {
    let found = record[place];
    let known = directions.iter().position(|&known| known == found);
    let [a, b] = directions;
    known.ok_or_else(|| format!("line {line}: `direction` is \"{found}\", expected {a} or {b}"))
}

/// What a line says between commas or semicolons, without the quotes that spreadsheets put round it. Separators within
/// quotes separate: no column of a test has any.
fn cells(line: &str, is_semicolon: bool) -> Vec<&str> {
    let cells = line.split(if is_semicolon { ';' } else { ',' });
    cells
        .map(|cell| cell.trim().trim_matches('"').trim())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lab(text: &str) -> Result<Lab, String> {
        let mut lab = Lab::default();
        let (test, columns, rows) = rows(text)?;
        lab.add(test, &columns, rows).map(|()| lab)
    }

    #[test]
    fn units_specimens_and_directions_are_told_apart() {
        let text = "specimen,direction,strain_percent,force_n_per_mm\nb,weft,1,2\na,weft,1,3\nb,weft,2,4\na,warp,1,5\n";
        let found = lab(text).unwrap();
        let values = |side: usize, number: usize| -> Vec<[f64; 2]> {
            let samples = found.tension[side][number].samples.iter();
            samples.map(|s| [s.at, s.value]).collect()
        };
        assert_eq!(values(1, 0), [[0.01, 2000.0], [0.02, 4000.0]]);
        assert_eq!(values(1, 1), [[0.01, 3000.0]]);
        assert_eq!(values(0, 0), [[0.01, 5000.0]]);
        assert!(found.tension[0][0].is_per_width);
        let found = lab("thickness_um;areal_mass_g_m2\n350,5;280\n").unwrap();
        assert!((found.thickness[0] - 350.5e-6).abs() < 1e-15);
        assert_eq!(found.areal_mass, [0.28]);
    }

    #[test]
    fn angles_and_forces_become_coefficients() {
        let found = lab("static_angle_deg,direction\n45,warp\n").unwrap();
        assert!((found.friction[0][0][0] - 1.0).abs() < 1e-15);
        assert!(found.friction[0][1].is_empty() && found.friction[1][0].is_empty());
        let found = lab("dynamic_force_n,normal_force_n\n0.5,2\n").unwrap();
        assert_eq!(found.friction, [[vec![], vec![0.25]], [vec![], vec![0.25]]]);
    }

    /// The load's work, F dd, is that of the moment C per area in both zones.
    #[test]
    fn bias_strip_does_the_work_of_its_zones() {
        let (h, w, modulus) = (0.3, 0.1, 20.0);
        let d = |angle: f64| (h - w) * ((0.5 * angle).cos() + (0.5 * angle).sin() - 1.0);
        let energy = |angle: f64| {
            let full = 0.5 * w * (2.0 * h - 3.0 * w) * 0.5 * modulus * angle * angle;
            full + w * w * 0.5 * modulus * (0.5 * angle).powi(2)
        };
        let (angle, step) = (0.4, 1e-5);
        let slope = |of: &dyn Fn(f64) -> f64| of(angle + step) - of(angle - step);
        let force = slope(&energy) / slope(&d);
        let text = format!(
            "displacement_mm,force_n,length_mm,width_mm\n{},{force},300,100\n",
            1e3 * d(angle)
        );
        let sample = lab(&text).unwrap().shear[1][0].samples[0];
        assert!((sample.at - angle).abs() < 1e-9, "{}", sample.at);
        let moment = modulus * (angle + sample.half * 0.5 * angle);
        assert!((sample.value / moment - 1.0).abs() < 1e-8);
    }

    #[test]
    fn what_is_no_test_is_named() {
        for (text, expected) in [
            ("", "is empty"),
            ("overhang_mm,direction\n", "no rows"),
            (
                "92.1,warp\n",
                "column 1 is \"92.1\", expected direction, specimen, or those of one test",
            ),
            (
                "overhang_inch,direction\n1,warp\n",
                "expected overhang_mm or overhang_cm",
            ),
            ("overhang_mm\n90\n", "no column `direction`"),
            (
                "overhang_mm,direction\n90,bias\n",
                "line 2: `direction` is \"bias\", expected warp or weft",
            ),
            (
                "overhang_mm,direction\n0,warp\n",
                "line 2: `overhang_mm` is \"0\", expected a number > 0",
            ),
            (
                "overhang_mm,direction\nNaN,warp\n",
                "line 2: `overhang_mm` is \"NaN\"",
            ),
            (
                "overhang_mm,direction\n1\n",
                "line 2: has 1 columns, expected 2",
            ),
            (
                "strain,force_n_per_mm,direction\n0.1,-3,warp\n",
                "line 2: `force_n_per_mm` is \"-3\", expected a number >= 0",
            ),
            ("strain,strain_percent\n", "says again"),
            ("strain,overhang_mm\n", "expected those of one test"),
            (
                "angle_deg,stress_mpa\n170,1\n",
                "line 2: `angle_deg` is \"170\"",
            ),
            (
                "displacement_mm,force_n,length_mm,width_mm\n1,1,150,100\n",
                "at least twice the width",
            ),
            (
                "displacement_mm,force_n,length_mm,width_mm\n90,1,300,100\n",
                "expected less than 0.0828",
            ),
        ] {
            let fault = lab(text).unwrap_err();
            assert!(fault.contains(expected), "{text}: {fault}");
        }
    }
}
