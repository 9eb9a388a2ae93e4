"""`example` writes what a case says, and only adds how well a number is known where the case is silent."""

from __future__ import annotations

from pathlib import Path

import pytest

from suite import plugins
from suite.__main__ import main, parser
from suite.model_file import read_model


def test_a_parameter_keeps_its_own_sd(tmp_path: Path) -> None:
    """The short period's derivatives are known as its case says."""
    assert main(["example", "aircraft-short-period", str(tmp_path)]) == 0
    written = read_model(tmp_path / "model.toml").parameters
    stated = plugins.cases()["aircraft-short-period"].deficient.parameters
    assert any(parameter.sd for parameter in stated.values())
    for name, parameter in stated.items():
        assert written[name].sd == parameter.sd


def test_a_silent_case_gets_five_per_cent(tmp_path: Path) -> None:
    """The paper's plant says nothing of its parameters; exact ones stay exact."""
    assert main(["example", "paper", str(tmp_path)]) == 0
    stated = plugins.cases()["paper-cubic"].deficient.parameters
    for name, parameter in read_model(tmp_path / "model.toml").parameters.items():
        silent = not stated[name].fixed and not stated[name].free and stated[name].sd is None
        wanted = pytest.approx(0.05 * abs(parameter.value)) if silent and parameter.value else stated[name].sd
        assert parameter.sd == wanted


@pytest.mark.parametrize("option", ["--data", "--source"])
def test_the_folder_of_measured_data_has_one_name_and_its_former_one(option: str, tmp_path: Path) -> None:
    """As in the messages of data that are not there: --data DIR."""
    args = parser().parse_args(["example", "silverbox", "out", option, str(tmp_path)])
    assert args.data == tmp_path
