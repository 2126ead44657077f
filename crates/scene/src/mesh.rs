//! Meshes as walls: triangles in a file of their own, which the crate that reads files fills in.

use std::collections::HashMap;
use std::sync::Arc;

use granulcal_numbers::General;
use serde::{Deserialize, Serialize};

use crate::check::positive;
use crate::error::SceneError;

/// Extent of a mesh, in diameters of a grain, beyond which its unit is taken for a mistake.
const MOST_DIAMETERS: f64 = 20_000.0;
/// Extent below which it is.
const LEAST_DIAMETERS: f64 = 0.5;

/// Triangles between shared vertices, in the units of their file.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// A mesh of `triangles`, each three of `vertices`. Equal vertices become one and triangles without area are left
    /// out, as exporters of STL write them.
    ///
    /// # Errors
    /// [`SceneError::Mesh`] for a vertex that is not there or not finite, or if no triangle is left; `file` is for the
    /// message.
    pub fn new(
        vertices: &[[f64; 3]],
        triangles: &[[u32; 3]],
        file: &str,
    ) -> Result<Self, SceneError> {
        let bad = |reason: String| SceneError::Mesh { file: file.to_owned(), reason };
        if let Some(index) = vertices.iter().position(|v| v.iter().any(|c| !c.is_finite())) {
            let [x, y, z] = vertices[index].map(General);
            return Err(bad(format!("vertex {index} is ({x}, {y}, {z}), must be finite")));
        }
        let mut number_of = HashMap::new();
        let mut kept = Vec::new();
        let welded: Vec<u32> = vertices
            .iter()
            .map(|vertex| {
                // -0 and 0 are one place.
                let key = vertex.map(|c| (c + 0.0).to_bits());
                *number_of.entry(key).or_insert_with(|| {
                    kept.push(*vertex);
                    kept.len() as u32 - 1
                })
            })
            .collect();
        let mut left = Vec::with_capacity(triangles.len());
        for (index, triangle) in triangles.iter().enumerate() {
            if let Some(&got) = triangle.iter().find(|&&v| v as usize >= vertices.len()) {
                let count = vertices.len();
                return Err(bad(format!("triangle {index} names vertex {got} of {count}")));
            }
            let corners = triangle.map(|v| welded[v as usize]);
            if area(corners.map(|v| kept[v as usize])) > 0.0 {
                left.push(corners);
            }
        }
        if left.is_empty() {
            let count = triangles.len();
            return Err(bad(format!("{count} triangles, none of which has an area")));
        }
        Ok(Self { vertices: kept, triangles: left })
    }

    /// Vertices, in the units of the file.
    pub fn vertices(&self) -> &[[f64; 3]] {
        &self.vertices
    }

    /// Corners of each triangle.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Edges that do not have exactly two triangles, in opposite directions: none if the mesh is closed.
    pub fn open_edges(&self) -> usize {
        let mut count: HashMap<[u32; 2], [usize; 2]> = HashMap::new();
        for &[a, b, c] in &self.triangles {
            for [from, to] in [[a, b], [b, c], [c, a]] {
                let edge = [from.min(to), from.max(to)];
                count.entry(edge).or_default()[usize::from(from > to)] += 1;
            }
        }
        count.values().filter(|&&uses| uses != [1, 1]).count()
    }

    /// Hash of its vertices and triangles, in their order (XXH3-64, hexadecimal).
    pub fn hash(&self) -> String {
        let vertices = self.vertices.iter().flatten().flat_map(|c| c.to_le_bytes());
        let triangles = self.triangles.iter().flatten().flat_map(|v| v.to_le_bytes());
        let bytes: Vec<u8> = vertices.chain(triangles).collect();
        format!("{:016x}", xxhash_rust::xxh3::xxh3_64(&bytes))
    }

    /// Largest extent along an axis, in the units of the file.
    pub fn extent(&self) -> f64 {
        let extent = |axis: usize| {
            let along = self.vertices.iter().map(|v| v[axis]);
            along.clone().fold(f64::MIN, f64::max) - along.fold(f64::MAX, f64::min)
        };
        (0..3).map(extent).fold(0.0, f64::max)
    }
}

fn area([a, b, c]: [[f64; 3]; 3]) -> f64 {
    let [a, b, c] = [a, b, c].map(nalgebra::Vector3::from);
    (b - a).cross(&(c - a)).norm()
}

/// A mesh and the file that it stands in.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshFile {
    /// An STL or OBJ file; a relative path is from the scene's file.
    pub file: String,
    /// Length of the file's unit `[m]`: 0.001 for millimetres, as most CAD programs write.
    pub unit: f64,
    /// Whether the mesh has to be closed (no holes, one side out). A shell that is open touches grains on both sides.
    #[serde(default)]
    pub closed: bool,
    /// Hash of the file (XXH3-64, hexadecimal), set when it is read; another file by that name is refused then. By it
    /// checkpoints and data sets tell one mesh from another.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hash: Option<String>,
    /// What stands in the file, once it has been read.
    #[serde(skip)]
    pub mesh: Option<Arc<Mesh>>,
}

impl MeshFile {
    /// A mesh made in memory, in units of `unit` `[m]`, under a name for messages. Its hash is that of its triangles,
    /// so that a checkpoint or a data set of another mesh is refused; from its TOML alone it cannot be had again.
    pub fn of(mesh: Mesh, name: &str, unit: f64, closed: bool) -> Self {
        let hash = Some(mesh.hash());
        Self { file: name.to_owned(), unit, closed, hash, mesh: Some(Arc::new(mesh)) }
    }

    /// The triangles, or what to do to have them.
    ///
    /// # Errors
    /// [`SceneError::Mesh`] if the file has not been read.
    pub fn read(&self) -> Result<&Arc<Mesh>, SceneError> {
        let reason = "has not been read: load the scene from its file";
        let unread = || SceneError::Mesh { file: self.file.clone(), reason: reason.to_owned() };
        self.mesh.as_ref().ok_or_else(unread)
    }

    pub(crate) fn check(&self, name: &str, diameter: f64) -> Result<(), SceneError> {
        positive(&format!("{name}.shape.unit"), self.unit)?;
        let mesh = self.read()?;
        let bad = |reason: String| SceneError::Mesh { file: self.file.clone(), reason };
        if self.hash.is_none() {
            return Err(bad(
                "has no hash, by which it is told from another: MeshFile::of sets it".to_owned()
            ));
        }
        let (unit, extent) = (self.unit, mesh.extent() * self.unit);
        if !(LEAST_DIAMETERS..=MOST_DIAMETERS).contains(&(extent / diameter)) {
            let [least, most] = [LEAST_DIAMETERS, MOST_DIAMETERS].map(|n| n * diameter);
            return Err(bad(format!(
                "is {} m large in units of {} m, must be {} to {} m for these grains; is the unit right?",
                General(extent),
                General(unit),
                General(least),
                General(most)
            )));
        }
        let open = if self.closed { mesh.open_edges() } else { 0 };
        if open > 0 {
            return Err(bad(format!(
                "has holes: {open} edges without exactly two triangles that face the same way; mend it or say \
                 closed = false"
            )));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f64; 3]; 4] = [[0.0; 3], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.0]];
    const FACES: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

    fn file(mesh: Mesh, unit: f64, closed: bool) -> MeshFile {
        MeshFile::of(mesh, "vessel.stl", unit, closed)
    }

    #[test]
    fn a_file_that_is_known_by_its_hash_may_lie_elsewhere() {
        let text = |place: &str, hash: &str| {
            format!("[shape]\nfile = \"{place}/vessel.stl\"\nunit = 0.001\nhash = \"{hash}\"\n")
        };
        let differ = |one: String, other: String| {
            let [one, other] = [one, other].map(|text| text.parse::<toml::Table>().unwrap());
            crate::first_difference("", Some(&one.into()), Some(&other.into())).map(|found| found.0)
        };
        assert_eq!(differ(text("/here", "a1"), text("/there", "a1")), None);
        let other = differ(text("/here", "a1"), text("/there", "b2"));
        assert!(other.is_some_and(|path| path.starts_with("shape.")));
        let unknown = |place: &str| format!("[shape]\nfile = \"{place}/vessel.stl\"\n");
        assert_eq!(differ(unknown("a"), unknown("b")), Some("shape.file".to_owned()));
    }

    #[test]
    fn a_mesh_made_in_memory_is_told_from_another_by_its_triangles() {
        let mesh = |corners: [[f64; 3]; 4]| Mesh::new(&corners, &FACES, "a.stl").unwrap();
        let mut moved = CORNERS;
        moved[3][2] = 9.0;
        let [one, same, other] = [CORNERS, CORNERS, moved].map(|of| file(mesh(of), 1e-3, false));
        assert_eq!(one.hash, same.hash);
        assert_ne!(one.hash, other.hash);
        let unknown = MeshFile { hash: None, ..one };
        let said = unknown.check("walls.0", 4e-3).unwrap_err().to_string();
        assert!(said.contains("vessel.stl has no hash") && said.contains("MeshFile::of"), "{said}");
    }

    #[test]
    fn soup_is_welded_and_slivers_are_dropped() {
        let soup: Vec<[f64; 3]> =
            FACES.iter().flat_map(|f| f.map(|v| CORNERS[v as usize])).collect();
        let mut triangles: Vec<[u32; 3]> = (0..4).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
        triangles.push([0, 0, 1]);
        let mesh = Mesh::new(&soup, &triangles, "a.stl").unwrap();
        assert_eq!((mesh.vertices().len(), mesh.triangles().len()), (4, 4));
        assert_eq!((mesh.open_edges(), mesh.extent()), (0, 10.0));
    }

    #[test]
    fn bad_meshes_are_named() {
        let message = |error: SceneError| error.to_string();
        let not_there = message(Mesh::new(&CORNERS, &[[0, 1, 7]], "a.stl").unwrap_err());
        assert!(not_there.contains("a.stl") && not_there.contains("vertex 7 of 4"), "{not_there}");
        let mut corners = CORNERS;
        corners[2][1] = f64::NAN;
        let nan = message(Mesh::new(&corners, &FACES, "a.stl").unwrap_err());
        assert!(nan.contains("vertex 2"), "{nan}");
        let flat = message(Mesh::new(&CORNERS, &[[0, 1, 1]], "a.stl").unwrap_err());
        assert!(flat.contains("none of which has an area"), "{flat}");

        let whole = Mesh::new(&CORNERS, &FACES, "a.stl").unwrap();
        let holed = Mesh::new(&CORNERS, &FACES[..3], "a.stl").unwrap();
        file(whole.clone(), 1e-3, true).check("walls.0", 4e-3).unwrap();
        file(holed.clone(), 1e-3, false).check("walls.0", 4e-3).unwrap();
        let holes = message(file(holed, 1e-3, true).check("walls.0", 4e-3).unwrap_err());
        assert!(holes.contains("vessel.stl has holes: 3 edges"), "{holes}");
        let mut turned = FACES;
        turned[3].swap(0, 1);
        let turned = Mesh::new(&CORNERS, &turned, "a.stl").unwrap();
        assert!(file(turned, 1e-3, true).check("walls.0", 4e-3).is_err());
        let large = message(file(whole, 10.0, true).check("walls.0", 4e-3).unwrap_err());
        assert!(large.contains("100 m large") && large.contains("unit"), "{large}");
    }
}
