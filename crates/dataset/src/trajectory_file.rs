//! Trajectories of walls from CSV files.

use std::path::Path;

use crate::{DatasetError, files};

/// Characters of a line that cannot be read that a message shows: the file may be a stranger's, or none that was meant.
const SHOWN: usize = 60;

/// The columns, in this order; a first line of names may be there or not.
const COLUMNS: &str = "time, x, y, z, qx, qy, qz, qw";

/// The knots of a trajectory: time `[s]`, displacement `[m]`, unit quaternion (x, y, z, w).
///
/// # Errors
/// [`DatasetError::Io`]; [`DatasetError::Content`] for a line that is not eight numbers.
pub(crate) fn read(path: &Path) -> Result<Vec<[f64; 8]>, DatasetError> {
    let text = files::read_text(path)?;
    let mut knots = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        let is_names = number == 0 && line.starts_with(|c: char| c.is_alphabetic());
        if line.is_empty() || line.starts_with('#') || is_names {
            continue;
        }
        let numbers: Result<Vec<f64>, _> = line.split(',').map(|n| n.trim().parse()).collect();
        let knot = numbers.ok().and_then(|numbers| <[f64; 8]>::try_from(numbers).ok());
        knots.push(knot.ok_or_else(|| {
            let what = format!("line {}", number + 1);
            let shown: String = line.chars().take(SHOWN).collect();
            DatasetError::content(path, what, format!("{shown:?}"), format!("{COLUMNS} as numbers"))
        })?);
    }
    Ok(knots)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_knots() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("way.csv");
        std::fs::write(
            &path,
            "time,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n# later\n1.5, 0.1,0,0, 0,0,0,1\n",
        )
        .unwrap();
        let knots = read(&path).unwrap();
        assert_eq!(knots.len(), 2);
        assert_eq!(knots[1], [1.5, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        std::fs::write(&path, "0,0,0,0,0,0,0,1\n1,2,3\n").unwrap();
        let message = read(&path).unwrap_err().to_string();
        assert!(message.contains("line 2") && message.contains("qx"), "{message}");
    }
}
