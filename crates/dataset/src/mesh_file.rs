//! Meshes from STL and OBJ files.

use std::collections::HashMap;
use std::io::Cursor;
use std::path::Path;

use granulcal_scene::Mesh;

use crate::{DatasetError, files};

/// Corners and triangles as they stand in a file.
type Soup = (Vec<[f64; 3]>, Vec<[u32; 3]>);

/// Reads a mesh; returns it with the hash of its file (XXH3-64, hexadecimal).
///
/// # Errors
/// [`DatasetError::Io`]; [`DatasetError::Content`] for what is neither STL nor OBJ; [`DatasetError::Simulation`] for
/// triangles that cannot be a wall.
pub(crate) fn read(path: &Path) -> Result<(Mesh, String), DatasetError> {
    let bytes = files::read_at_most(path, files::LARGEST_PART)?;
    let is_obj = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("obj"));
    let is_stl = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("stl"));
    let unreadable = |what: &str, why: String| {
        DatasetError::content(path, format!("a mesh in {what}"), why, "triangles that can be read")
    };
    let (vertices, triangles) = if is_obj {
        obj(&bytes).map_err(|error| unreadable("OBJ", error.to_string()))?
    } else if is_stl {
        stl(&bytes).map_err(|error| unreadable("STL", error.to_string()))?
    } else {
        let found = path.extension().map_or("no ending".into(), |end| end.to_string_lossy());
        return Err(DatasetError::content(path, "a mesh's file", found, "named .stl or .obj"));
    };
    let name = path.display().to_string();
    let mesh = Mesh::new(&vertices, &triangles, &name).map_err(DatasetError::refused)?;
    Ok((mesh, format!("{:016x}", xxhash_rust::xxh3::xxh3_64(&bytes))))
}

/// Text or binary, by its first bytes.
fn stl(bytes: &[u8]) -> std::io::Result<Soup> {
    let mut vertices = Vec::new();
    for triangle in stl_io::create_stl_reader(&mut Cursor::new(bytes))? {
        vertices.extend(triangle?.vertices.map(|vertex| vertex.0.map(f64::from)));
    }
    let triangles = (0..vertices.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
    Ok((vertices, triangles.collect()))
}

/// All objects of the file, polygons cut into triangles; materials are of no interest.
fn obj(bytes: &[u8]) -> Result<Soup, tobj::LoadError> {
    let options = tobj::LoadOptions { triangulate: true, ..tobj::LoadOptions::default() };
    let no_material = |_: &Path| Ok((Vec::new(), HashMap::default()));
    let (models, _) = tobj::load_obj_buf(&mut Cursor::new(bytes), &options, no_material)?;
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for tobj::Model { mesh, .. } in &models {
        let first = vertices.len() as u32;
        vertices.extend(mesh.positions.chunks_exact(3).map(|v| [v[0], v[1], v[2]]));
        let corners = mesh.indices.chunks_exact(3);
        triangles.extend(corners.map(|t| [first + t[0], first + t[1], first + t[2]]));
    }
    Ok((vertices, triangles))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ASCII: &str = "solid tray\n\
        facet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 40 0 0\n  vertex 0 40 0\n endloop\nendfacet\n\
        facet normal 0 0 1\n outer loop\n  vertex 40 0 0\n  vertex 40 40 0\n  vertex 0 40 0\n endloop\nendfacet\n\
        endsolid tray\n";
    const OBJ: &str = "o tray\nv 0 0 0\nv 40 0 0\nv 40 40 0\nv 0 40 0\nf 1 2 3 4\n";

    fn binary() -> Vec<u8> {
        let mut bytes = vec![0; 80];
        bytes.extend(2u32.to_le_bytes());
        for corners in [[[0., 0.], [40., 0.], [0., 40.]], [[40., 0.], [40., 40.], [0., 40.]]] {
            let normal = [0f32, 0.0, 1.0];
            let corners = corners.into_iter().flat_map(|[x, y]: [f32; 2]| [x, y, 0.0]);
            bytes.extend(normal.into_iter().chain(corners).flat_map(f32::to_le_bytes));
            bytes.extend([0, 0]);
        }
        bytes
    }

    #[test]
    fn stl_as_text_and_binary_and_obj_are_one_mesh() {
        let folder = tempfile::tempdir().unwrap();
        let read_as = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            read(&path)
        };
        for (name, bytes) in
            [("a.stl", ASCII.as_bytes()), ("b.STL", &binary()), ("c.obj", OBJ.as_bytes())]
        {
            let (mesh, hash) = read_as(name, bytes).unwrap();
            assert_eq!((mesh.vertices().len(), mesh.triangles().len()), (4, 2), "{name}");
            assert_eq!((mesh.extent(), hash.len(), mesh.open_edges()), (40.0, 16, 4), "{name}");
        }
        for (name, bytes, named) in [
            ("d.stl", &binary()[..100], "d.stl"),
            ("e.ply", OBJ.as_bytes(), "named .stl or .obj"),
            ("f.obj", b"f 1 2 3\n", "f.obj"),
        ] {
            let message = read_as(name, bytes).unwrap_err().to_string();
            assert!(message.contains(named), "{message}");
        }
        let many = [&[0; 80][..], &u32::MAX.to_le_bytes(), &binary()[84..]].concat();
        for (number, (ending, bytes)) in [
            ("stl", &b""[..]),
            ("stl", b"solid a\nendsolid a\n"),
            ("stl", b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 NaN\nvertex 1 0 0\nvertex 0 1 0\n"),
            ("stl", &[0; 84]),
            ("stl", &many),
            ("obj", b""),
            ("obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"),
            ("obj", b"v 0 0 NaN\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
            ("obj", b"v 0 0 inf\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
            ("obj", b"v 0 0 1e999\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
            ("obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n"),
            ("obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n"),
            ("obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -4\n"),
            ("obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n"),
            ("obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf\n"),
            ("obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n"),
            ("obj", b"v 0 0 0\nv 1 0 0\nl 1 2\np 1\n"),
            ("obj", b"v 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
            ("obj", b"\xff\xfe\n"),
        ]
        .into_iter()
        .enumerate()
        {
            let Err(error) = read_as(&format!("{number}.{ending}"), bytes) else {
                panic!("{number}: {bytes:?}");
            };
            assert!(format!("{error:?}").contains(&format!("{number}.{ending}")), "{error:?}");
        }
        let mut nan = binary();
        nan[96..100].copy_from_slice(&f32::NAN.to_le_bytes());
        let message = read_as("g.stl", &nan).unwrap_err();
        assert!(format!("{message:?}").contains("must be finite"), "{message:?}");
    }
}
