//! Trajectories of walls from CSV files.

use std::path::Path;

use crate::{DatasetError, files};

/// Numbers of a knot.
const KNOT: usize = 8;
/// The columns, in this order; a first line of names may be there or not, and has none of these at another place.
const COLUMNS: &str = "time, x, y, z, qx, qy, qz, qw";

/// The knots of a trajectory: time `[s]`, displacement `[m]`, unit quaternion (x, y, z, w).
///
/// # Errors
/// [`DatasetError::Io`]; [`DatasetError::Content`] for a line that is not eight numbers, or names in another order.
pub(crate) fn read(path: &Path) -> Result<Vec<[f64; KNOT]>, DatasetError> {
    let text = files::read_text(path)?;
    let mut knots = Vec::new();
    // Spreadsheets begin a text with a mark of its encoding.
    for (number, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let line = line.trim();
        let is_names = number == 0 && line.starts_with(|c: char| c.is_alphabetic());
        if let Some(found) = is_names.then(|| misplaced(line)).flatten() {
            let wanted = format!("the names {COLUMNS} in this order");
            return Err(DatasetError::content(path, "line 1", found, wanted));
        }
        if line.is_empty() || line.starts_with('#') || is_names {
            continue;
        }
        let numbers: Result<Vec<f64>, _> = line.split(',').map(|n| n.trim().parse()).collect();
        let knot = numbers.ok().and_then(|numbers| <[f64; KNOT]>::try_from(numbers).ok());
        knots.push(knot.ok_or_else(|| {
            // Nothing of the line itself: a stranger's scene may name a file that is none of theirs.
            let what = format!("line {}", number + 1);
            DatasetError::content(path, what, wrong(line), format!("{COLUMNS} as numbers"))
        })?);
    }
    Ok(knots)
}

/// The first of the columns that a line of names has at another place than its own, such as a quaternion's w before x.
fn misplaced(line: &str) -> Option<String> {
    let columns: Vec<_> = COLUMNS.split(", ").collect();
    line.split(',').enumerate().find_map(|(at, name)| {
        let own = columns.iter().position(|column| column.eq_ignore_ascii_case(name.trim()))?;
        (own != at).then(|| format!("{} in column {}", columns[own], at + 1))
    })
}

/// Why a line is no knot.
fn wrong(line: &str) -> String {
    let columns: Vec<_> = line.split(',').map(str::trim).collect();
    match columns.iter().position(|column| column.parse::<f64>().is_err()) {
        Some(at) if columns.len() == KNOT => format!("no number in column {}", at + 1),
        _ => format!("{} of {KNOT} columns", columns.len()),
    }
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
        assert!(message.contains("3 of 8 columns"), "{message}");
    }

    #[test]
    fn names_in_another_order_are_refused_and_a_spreadsheets_mark_is_none() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("way.csv");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read(&path).map_err(|error| error.to_string())
        };
        let message = read("time,x,y,z,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n").unwrap_err();
        assert!(message.contains("line 1 must be the names time, x, y, z, qx"), "{message}");
        assert!(message.contains("qw in column 5"), "{message}");
        let knots = read("\u{feff}Time, X, Y, Z, qx, qy, qz, qw\r\n0,0,0,0,0,0,0,1\r\n").unwrap();
        assert_eq!(knots, [[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]);
        // Names of one's own tell no order.
        assert_eq!(read("t,a,b,c,d,e,f,g\n0,0,0,0,0,0,0,1\n").unwrap(), knots);
    }

    #[test]
    fn a_message_has_nothing_of_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("passwords");
        let said = |text: &str| {
            std::fs::write(&path, text).unwrap();
            read(&path).unwrap_err().to_string()
        };
        let message = said("root:x:0:0:root:/root:/bin/sh\nsecret:x:1:1:secret:/:/bin/sh\n");
        assert!(message.contains("line 2") && !message.contains("secret"), "{message}");
        let message = said("0,0,0,secret,0,0,0,1\n");
        assert!(
            message.contains("no number in column 4") && !message.contains("secret"),
            "{message}"
        );
    }
}
