"""What the front door returns for a user's own lasers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from reproduce.papers.chen2023.platform import INSTRUMENT, as_designed
from reproduce.physics.attitude import Platform, monitored
from reproduce.physics.attitude.diagnosis import diagnose, refuse, seen
from reproduce.printed.given import given
from reproduce.store.spots import read_images
from reproduce.units import ARCSEC_PER_RADIAN
from reproduce.views.objects.base import text_of
from reproduce.views.objects.measurements import _Measured
from reproduce.views.platforms import platform_of

if TYPE_CHECKING:
    import pandas as pd

# Of the interval that a table shows.
SHARE = 0.95


class Monitored(_Measured):
    """The misalignment of a user's own camera, image by image.

    What is doubtful about the spots stands in ``findings``, and with what the reading says in
    ``remarks``. It is made from the arguments of `reproduce.misalignment`.
    """

    def __init__(
        self,
        spots: str | Path | ArrayLike,
        zero: ArrayLike | None = None,
        platform: Platform | str | Path | None = None,
    ) -> None:
        self._spots, self._zero = spots, zero
        self.reads = INSTRUMENT if platform is None else ()
        self.platform = (
            as_designed(given(INSTRUMENT)) if platform is None else platform_of(platform)
        )
        images, notes = read_images(spots, zero, len(self.platform.lasers))
        chosen, images, lights = seen(self.platform, images)
        self.findings = diagnose(chosen, images, numbers=lights)
        refuse(self.findings, str(spots) if isinstance(spots, str | Path) else "the spots")
        self.found = monitored(*images, chosen)
        self.angles = self.found.angles
        self.remarks = [*(one.text for one in self.findings), *notes]
        self.title = f"misalignment in {len(self.angles)} images since the zero point"

    @property
    def source(self) -> str:
        """The text of the function that computes the angles."""
        return text_of(monitored)

    def images(self) -> pd.DataFrame:
        """Return the angles of every image about X, Y and Z of the camera, in arcsec.

        They are NaN where fewer than two lights are seen.
        """
        import pandas as pd

        index = pd.RangeIndex(1, len(self.angles) + 1, name="image")
        return pd.DataFrame(self.angles * ARCSEC_PER_RADIAN, index, columns=list("XYZ"))

    def interval(self, share: float = SHARE) -> pd.DataFrame:
        """Return the interval of the mean that holds the truth so often, in arcsec.

        By Student's law: the scatter of the images is estimated.
        """
        import pandas as pd

        low, high = self.found.interval(share) * ARCSEC_PER_RADIAN
        index = pd.Index(list("XYZ"), name="about")
        return pd.DataFrame({"low (arcsec)": low, "high (arcsec)": high}, index)

    def frame(self) -> pd.DataFrame:
        """Return mean, scatter of one image, error and interval of the mean, in arcsec.

        The error counts both groups: the zero point is itself a mean over images.
        """
        import pandas as pd

        found = self.found
        columns = {"mean": found.mean, "scatter": found.scatter, "error of the mean": found.error}
        shown = {f"{name} (arcsec)": one * ARCSEC_PER_RADIAN for name, one in columns.items()}
        interval = self.interval().add_prefix(f"{SHARE:.0%} ")
        return pd.DataFrame(shown, interval.index).join(interval)

    def record(self) -> dict[str, Any]:
        """Return everything for other programs; what the spots do not tell is None."""
        angles = self.frame().astype(object).where(self.frame().notna(), None)
        return {
            "images": len(self.angles),
            "angles": angles.reset_index().to_dict("records"),
            "findings": [vars(one) for one in self.findings],
            "remarks": self.remarks,
        }

    def rerun(
        self,
        platform: Platform | str | Path | None = None,
        *,
        spots: str | Path | ArrayLike | None = None,
        zero: ArrayLike | None = None,
    ) -> Monitored:
        """Return the same with other spots, or with another platform."""
        zero_of = self._zero if spots is None and zero is None else zero
        chosen = self._spots if spots is None else spots
        kept = None if self.reads else self.platform
        return Monitored(chosen, zero_of, kept if platform is None else platform)
