//! Names of parameters as short as tables want them.

/// The last word of each path; as many as it takes where several end alike (`python/granulcal/short_names.py`).
pub(crate) fn short_names(paths: &[String]) -> Vec<String> {
    let parts: Vec<Vec<&str>> = paths.iter().map(|path| path.split('.').collect()).collect();
    let of = |mine: &Vec<&str>| {
        let is_alone = |count: &usize| {
            let end = &mine[mine.len() - count..];
            parts.iter().all(|other| other == mine || !other.ends_with(end))
        };
        let count = (1..mine.len()).find(is_alone).unwrap_or(mine.len());
        mine[mine.len() - count..].join(".")
    };
    parts.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::short_names;

    #[test]
    fn paths_that_end_alike_keep_what_tells_them_apart() {
        let of = |paths: &[&str]| {
            short_names(&paths.iter().map(|p| (*p).to_owned()).collect::<Vec<_>>())
        };
        assert_eq!(of(&["material.friction", "ground.height"]), ["friction", "height"]);
        assert_eq!(
            of(&["material.friction", "effects.ground.friction"]),
            ["material.friction", "ground.friction"]
        );
        assert_eq!(of(&["friction", "ground.friction"]), ["friction", "ground.friction"]);
    }
}
