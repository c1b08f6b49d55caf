"""A user's own files: every model that takes one gets the truth back, and says what is wrong."""

import numpy as np
import pandas as pd
import pytest

import reproduce as rp
from reproduce.papers.chen2023.platform import INSTRUMENT, as_designed
from reproduce.papers.posteriors import posteriors
from reproduce.physics.attitude import stage_angles
from reproduce.physics.registration import fit_registration
from reproduce.printed.inputs import load_inputs
from reproduce.store.points import STARS as COLUMNS
from reproduce.store.points import TableFileError

READERS = {
    key: one.file for key, one in posteriors().items() if not isinstance(one.file, str)
}

STARS = np.random.default_rng(1).uniform(0, 1000, (40, 2))


def from_file(name, path):
    """A user's file as a model."""
    return rp.posterior(name, path).model


def written(tmp_path, columns, rows):
    path = tmp_path / "data.csv"
    path.write_text(
        "\n".join([",".join(columns), *(",".join(map(str, row)) for row in rows)])
    )
    return path


def star_rows(columns):
    generator = np.random.default_rng(2)
    moved = [
        STARS
        - np.array([3.0, 0.0]) * (i > 0)
        + 0.1 * generator.normal(size=STARS.shape)
        for i in range(len(columns) // 2)
    ]
    return np.concatenate(moved, axis=1).round(4).tolist()


def spot_rows(columns):
    """Twenty images in each of two groups."""
    instrument = as_designed(load_inputs(INSTRUMENT))
    generator = np.random.default_rng(1)
    turns = stage_angles(
        np.array([[0.0, 0.0], [20e-6, 0.0]]), instrument.camera_focal_length
    )
    rows = []
    for group, turn in enumerate(turns):
        spots = instrument.predicted(np.zeros((1, 3)), turn[None, None])[0, 0]
        for image in spots + 0.02 * generator.normal(size=(20, *spots.shape)):
            for laser, (x, y) in enumerate(image.round(4), start=1):
                rows.append((group, laser, x, y))
    return rows


def rows_for(name):
    columns = READERS[name].columns
    if name.startswith("registration"):
        return star_rows(columns)
    return spot_rows(columns)


@pytest.mark.parametrize(
    ("name", "parameter", "truth"),
    [
        ("registration", "shift-x", 3.0),
        ("misalignment", "angle-y", -20e-6 / 2),
        ("misalignment-drift", "drift-x", 0.0),
    ],
)
def test_users_data_lead_to_their_own_truth(tmp_path, name, parameter, truth):
    """By the rough estimate that starts the sampler, within a few of its errors."""
    model = from_file(name, written(tmp_path, READERS[name].columns, rows_for(name)))
    centre, spread = model.likelihood.start()
    i = model.names.index(parameter)
    assert abs(centre[i] - truth) < 4 * spread[i]
    assert spread[i] < 0.1 * max(abs(truth), 1e-4)


def replaced(rows, row, column, value):
    rows = [list(one) for one in rows]
    rows[row][column] = value
    return rows


@pytest.mark.parametrize(
    ("name", "row", "column", "value", "message"),
    [
        ("misalignment", 9, 0, 2, r"row 9, column group"),
        ("misalignment-drift", 9, 1, 5, r"row 9, column laser: .* 1 to 4"),
        ("misalignment", 9, 1, 3, r"row 9: .* column frame"),
    ],
)
def test_wrong_files_are_refused_by_row_and_column(
    tmp_path, name, row, column, value, message
):
    rows = replaced(rows_for(name), row, column, value)
    with pytest.raises(TableFileError, match=message):
        from_file(name, written(tmp_path, READERS[name].columns, rows))


def test_priors_follow_the_data_and_not_the_paper(tmp_path):
    """A field ten times as large: priors in px ten times as wide."""
    widths, columns = [], READERS["registration"].columns
    for size in (1, 10):
        rows = (np.array(star_rows(columns)) * size).tolist()
        model = from_file("registration", written(tmp_path, columns, rows))
        widths.append([one.prior.high for one in model.parameters[2:]])
        fit = model.likelihood.fit
        residual = np.sqrt(fit.chi_square / fit.degrees_of_freedom)
        np.testing.assert_allclose(widths[-1][-1], 1e3 * residual)
    np.testing.assert_allclose(np.array(widths[1]) / widths[0], 10)


@pytest.mark.parametrize("name", sorted(posteriors().keys() - READERS.keys()))
def test_a_model_without_files_says_why(tmp_path, name):
    with pytest.raises(
        TableFileError, match=f"{name} takes no file: .* registration and"
    ):
        rp.posterior(name, tmp_path / "none.csv")


def test_weights_count_in_the_registration_alone():
    """A star of no weight is left out; the mixture says that it takes no weights."""
    generator = np.random.default_rng(5)
    source = generator.uniform(0, 500, (30, 2))
    target = 1.01 * source + generator.normal(0, 0.1, source.shape)
    weight = generator.uniform(0.1, 10, 30) * (np.arange(30) > 2)
    frame = pd.DataFrame(np.hstack([source, target]), columns=list(COLUMNS)).assign(
        weight=weight
    )
    found = rp.posterior("registration", data=frame, pivot=(0.0, 0.0))
    fit = fit_registration(source, target, (0.0, 0.0), weight)
    centre, spread = found.model.likelihood.start()
    np.testing.assert_allclose(centre[:4], fit.parameters, rtol=1e-9)
    np.testing.assert_allclose(spread[:4], fit.standard_errors, rtol=1e-9)
    assert not any("takes no column" in one for one in found.remarks)
    # The likelihood is that of the stars one by one.
    likelihood, own = found.model.likelihood, weight[3:] / weight[3:].mean()
    left = target[3:] - likelihood.places(centre[None])[0]
    variance = (centre[4] ** 2 / own)[:, None]
    each = -0.5 * left**2 / variance - 0.5 * np.log(2 * np.pi * variance)
    assert likelihood(centre[None])[0] == pytest.approx(each.sum(), rel=1e-9)
    for bad, said in (
        (0.0, "at least one above zero"),
        (-weight, "expected zero or more"),
    ):
        with pytest.raises(TableFileError, match=said):
            rp.posterior("registration", data=frame.assign(weight=bad))
    mixture = rp.posterior("registration-mixture", data=frame, pivot=(0.0, 0.0))
    assert "this model takes no column weight" in mixture.remarks
    assert len(mixture.model.likelihood.source) == 30
