"""What the page on the tests calls: how many small changes of the code the tests notice."""

from __future__ import annotations

import functools
import hashlib
from pathlib import Path

from markupsafe import Markup

import reproduce
from reproduce.audit.mutation import Reason, Study, Tally, reasons, stored, tally
from reproduce.locate import data_folder
from reproduce.views.audit_pages import html_table
from reproduce.views.pages import Html

_THIN = "\u202f%"
# Of the interval of the killed share.
CONFIDENCE = 0.95


@functools.cache
def _study() -> tuple[Study, dict[str, Reason]]:
    folder = data_folder() / "studies"
    study = stored((folder / "mutants.toml").read_text(encoding="utf-8"))
    text = (folder / "mutants-survivors.toml").read_text(encoding="utf-8")
    return study, reasons(text, study)


def tallies() -> dict[str, Tally]:
    """Return the counts of each folder, and of all."""
    study, why = _study()
    found = {
        folder: tally((one for one in study.mutants if one.folder == folder), why)
        for folder in study.made
    }
    return {**found, "all": tally(study.mutants, why)}


def stale() -> list[str]:
    """Return the files that have changed since the study, in order."""
    study, _ = _study()
    package = Path(reproduce.__file__).parent
    hashes = study.note["sources"]
    if not isinstance(hashes, dict):
        raise TypeError(f"expected a table of hashes, got {hashes!r}")
    return [
        file
        for file, digest in hashes.items()
        if not (package / file).is_file()
        or hashlib.sha256((package / file).read_bytes()).hexdigest() != digest
    ]


def score() -> Html:
    """Show how many mutants of each folder the tests kill."""
    study, _ = _study()
    made = {**study.made, "all": sum(study.made.values())}
    heads = ["Folder", "Made", "Drawn", "Killed", "of these by time", "Survived", "Equivalent"]
    heads += ["Killed share of all drawn (95 % interval)", "of all but the equivalent"]
    rows = []
    for folder, found in tallies().items():
        share, low, high = found.share(CONFIDENCE)
        counts = (found.sampled, found.killed, found.timeouts, found.survived, found.equivalent)
        shares = (f"{share:.1%} ({low:.1%} to {high:.1%})", f"{found.share_of_killable:.1%}")
        rows.append([_text(entry) for entry in (folder, made[folder], *counts, *shares)])
    return Html(html_table(heads, rows, "Mutants, by folder", "rp-table rp-score"))


def survivors() -> Html:
    """Show every mutant that no test noticed, and why."""
    study, why = _study()
    rows = []
    for one in study.mutants:
        if one.outcome == "survived":
            place = Markup("<code>{}</code>, line {}").format(one.file, one.line)
            change = Markup("<code>{}</code><br>becomes <code>{}</code>")
            kind = "equivalent" if why[one.name].equivalent else "unseen"
            reason = Markup("{}: {}").format(kind, why[one.name].text)
            rows.append([place, change.format(one.before, one.after), reason])
    heads = ("Where", "Change", "Why it survives")
    return Html(html_table(heads, rows, "Surviving mutants", "rp-table rp-small rp-audit"))


def operators() -> Html:
    """Show which changes are made, in the tool's words, and how many of each were drawn."""
    study, _ = _study()
    names = study.note["operators"]
    if not isinstance(names, list):
        raise TypeError(f"expected a list of operators, got {names!r}")
    rows = []
    for name in names:
        drawn = [one for one in study.mutants if one.operator.endswith(f"/{name}")]
        killed = sum(one.outcome != "survived" for one in drawn)
        rows.append([Markup("<code>{}</code>").format(name), _text(len(drawn)), _text(killed)])
    return Html(html_table(("Operator", "Drawn", "Killed"), rows, "Operators", "rp-table rp-score"))


def _text(entry: object) -> Markup:
    return Markup("{}").format(str(entry).replace("%", _THIN))


def glue() -> None:
    """Make the numbers of this page available to its sentences.

    ``mutants-made``, ``mutants-drawn``, ``mutants-killed``, ``mutants-survived``,
    ``mutants-equivalent``, ``mutants-share``, ``mutants-low``, ``mutants-high``,
    ``mutants-share-killable``, ``mutants-tool``, ``mutants-seed``, ``mutants-met``,
    ``mutants-files``, ``mutants-stale``, ``mutants-confidence``.
    """
    from myst_nb import glue as glue_one

    for label, value in numbers().items():
        glue_one(f"mutants-{label}", value, display=False)


def numbers() -> dict[str, str]:
    """Return what `glue` hands out, without the common beginning of the labels."""
    study, _ = _study()
    found = tallies()["all"]
    share, low, high = found.share(CONFIDENCE)
    percents = {"share": share, "low": low, "high": high, "share-killable": found.share_of_killable}
    sources = study.note["sources"]
    said = {
        "made": sum(study.made.values()),
        "drawn": found.sampled,
        "killed": found.killed,
        "survived": found.survived,
        "equivalent": found.equivalent,
        "tool": study.note["tool"],
        "seed": study.note["seed"],
        "confidence": f"{CONFIDENCE:.0%}".replace("%", _THIN),
        "met": study.note["survivors_met"],
        "files": len(sources) if isinstance(sources, dict) else 0,
        "stale": len(stale()),
        **{label: f"{value:.1%}".replace("%", _THIN) for label, value in percents.items()},
    }
    return {label: str(value) for label, value in said.items()}
