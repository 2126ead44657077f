//! What every effect can be asked.

use crate::error::SceneError;

/// One effect, as all of them are walked over: see [`Effects::all`](super::Effects::all).
pub trait Effect {
    /// Its table in a scene, for example `effects.capillary`.
    fn path(&self) -> &'static str;

    /// Checks every number.
    ///
    /// # Errors
    /// [`SceneError::OutOfRange`] names the number by its path.
    fn check(&self) -> Result<(), SceneError>;

    /// Whether it does anything. One that is off changes no bit of a pour.
    fn is_on(&self) -> bool;

    /// Whether it changes what a contact is: only the method nsgs knows those.
    fn changes_contacts(&self) -> bool {
        false
    }
}
