//! What a model says of the law of the solver that its pours follow.

use serde::{Deserialize, Deserializer};

/// Number of another simulator's law, whatever it is.
const ANOTHER_SIMULATOR: u32 = 0;

/// The law that the pours of a model's training follow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StatedLaw {
    /// Nothing is said: the model is of before laws had numbers.
    #[default]
    Unstated,
    /// The pairs of parameters and statistics were handed in: they are of no law that is known.
    Unknown,
    /// The law of this number; 0 is another simulator's.
    Number(u32),
}

impl StatedLaw {
    /// The law in words, if it is another than `today`'s; a model without a scene that says nothing is of no pours.
    pub fn other_than(self, today: u32, has_scene: bool) -> Option<String> {
        match self {
            Self::Unstated if has_scene => Some("one of before laws had numbers".to_owned()),
            Self::Number(law) if law != ANOTHER_SIMULATOR && law != today => Some(law.to_string()),
            _ => None,
        }
    }
}

impl<'de> Deserialize<'de> for StatedLaw {
    /// Null is a law that nobody knows.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(Option::deserialize(deserializer)?.map_or(Self::Unknown, Self::Number))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_another_law_is_told() {
        for (law, has_scene, said) in [
            (StatedLaw::Unstated, true, Some("one of before laws had numbers")),
            (StatedLaw::Unstated, false, None),
            (StatedLaw::Unknown, true, None),
            (StatedLaw::Unknown, false, None),
            (StatedLaw::Number(0), true, None),
            (StatedLaw::Number(7), true, None),
            (StatedLaw::Number(6), true, Some("6")),
            (StatedLaw::Number(6), false, Some("6")),
        ] {
            assert_eq!(law.other_than(7, has_scene).as_deref(), said, "{law:?} {has_scene}");
        }
    }

    #[test]
    fn null_is_not_absent() {
        #[derive(Deserialize)]
        struct Document {
            #[serde(default)]
            law: StatedLaw,
        }
        for (text, law) in [
            ("{}", StatedLaw::Unstated),
            (r#"{"law": null}"#, StatedLaw::Unknown),
            (r#"{"law": 0}"#, StatedLaw::Number(0)),
        ] {
            assert_eq!(serde_json::from_str::<Document>(text).unwrap().law, law, "{text}");
        }
        assert!(serde_json::from_str::<Document>(r#"{"law": -1}"#).is_err());
    }
}
