//! How the cameras are mounted: each axis of the robot's frame 0 as an axis of the left camera, as in `x0=-y y0=z z0=-x`.
//!
//! The camera's x points right, y down, z along the view. Read as equations between coordinates, `p_0 = R p_left`: the three right-hand
//! sides are the rows of `R`.

use std::str::FromStr;

use nalgebra::{Matrix3, Rotation3};

/// A rotation by whole quarter turns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mount {
    /// `p_0 = base_from_left p_left`, up to a shift.
    pub base_from_left: Rotation3<f64>,
}

impl FromStr for Mount {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut rows: [Option<[f64; 3]>; 3] = [None; 3];
        for equation in text.split([' ', ',', ';']).filter(|part| !part.is_empty()) {
            let (row, values) = parse(equation).ok_or_else(|| format!("`{equation}` is not of the form `x0=-y`"))?;
            if rows[row].replace(values).is_some() {
                return Err(format!("{} is given twice", ["x0", "y0", "z0"][row]));
            }
        }
        let [Some(x), Some(y), Some(z)] = rows else {
            return Err("x0, y0 and z0 are all needed, as in `x0=-y y0=z z0=-x`".to_owned());
        };
        let matrix = Matrix3::from_row_slice(&[x, y, z].concat());
        match matrix.determinant() {
            d if d > 0.5 => Ok(Self { base_from_left: Rotation3::from_matrix_unchecked(matrix) }),
            d if d < -0.5 => Err("this is a mirror image, no rotation; one of the signs is wrong".to_owned()),
            _ => Err("a camera axis is used twice".to_owned()),
        }
    }
}

/// Row of the matrix and its numbers.
fn parse(equation: &str) -> Option<(usize, [f64; 3])> {
    let (left, right) = equation.split_once('=')?;
    let row = ["x0", "y0", "z0"].iter().position(|name| *name == left)?;
    let (sign, axis) = match right.strip_prefix(['-', '+']) {
        Some(axis) => (if right.starts_with('-') { -1.0 } else { 1.0 }, axis),
        None => (1.0, right),
    };
    let column = ["x", "y", "z"].iter().position(|name| *name == axis)?;
    let mut values = [0.0; 3];
    values[column] = sign;
    Some((row, values))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_labs_mount() {
        let mount: Mount = "x0=-y y0=z z0=-x".parse().unwrap();
        // What is below and before the camera is low and far along y0.
        assert_eq!(mount.base_from_left * Vector3::new(1.0, 2.0, 3.0), Vector3::new(-2.0, 3.0, -1.0));
        assert_eq!("z0 = x".parse::<Mount>().unwrap_err(), "`z0` is not of the form `x0=-y`");
    }

    proptest! {
        #[test]
        fn only_rotations_are_taken(axes in prop::array::uniform3(0..3_usize), signs in prop::array::uniform3(any::<bool>())) {
            let names = ["x", "y", "z"];
            let side = |i: usize| format!("{}0={}{}", names[i], if signs[i] { "-" } else { "" }, names[axes[i]]);
            let text = format!("{},{} {}", side(2), side(0), side(1));
            let matrix = Matrix3::from_fn(|r, c| if axes[r] == c { if signs[r] { -1.0_f64 } else { 1.0 } } else { 0.0 });
            match text.parse::<Mount>() {
                Ok(mount) => {
                    prop_assert!((matrix.determinant() - 1.0).abs() < 1e-12);
                    prop_assert_eq!(*mount.base_from_left.matrix(), matrix);
                }
                Err(sentence) => {
                    prop_assert!(matrix.determinant() < 0.5);
                    prop_assert_eq!(sentence.contains("mirror"), matrix.determinant() < -0.5);
                }
            }
        }

        #[test]
        fn any_text_is_read_or_refused(text in "\\PC{0,40}") {
            let _ = text.parse::<Mount>();
        }
    }
}
