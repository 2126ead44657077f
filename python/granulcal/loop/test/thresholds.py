"""Every number that turns a p-value or an evidence into a word, fixed before data are seen."""

from dataclasses import asdict, dataclass

__all__ = ["Thresholds"]


@dataclass(frozen=True)
class Thresholds:
    """Thresholds of a verdict; write them down before the first residual.

    Attributes:
        detect: largest p of the residual test at which a residual is called detected.
        name: largest p of the residual test at which an effect may be named.
        adequate: smallest p of the residual test after a fit that counts as an explanation.
        rivals: models within this of the best log evidence are not distinguished, the model
            without effects among them [nat].
        null_share, single_share: prior probability of no effect, and of one effect; the rest is
            that of two.
        pairs: largest number of pairs of effects that are fitted, the more probable singles first.
        replicates: of the residual test before any effect is fitted.
        replicates_after: of the residual test after each fit.
        refits: replicates that are refitted in full to scale the linear ones.
        level: of intervals.
        confirm: smallest p of fresh pours at which the surrogate counts as right at the fit.
        look: random draws of the winner that are poured before a verdict is said; 0 for none.
    """

    detect: float = 0.05
    name: float = 0.01
    adequate: float = 0.02
    rivals: float = 3.0
    null_share: float = 0.5
    single_share: float = 0.4
    pairs: int = 200
    replicates: int = 2000
    replicates_after: int = 600
    refits: int = 32
    level: float = 0.95
    confirm: float = 0.01
    look: int = 24

    def to_dict(self) -> dict[str, float]:
        """Returns the numbers by name."""
        return asdict(self)
