"""Top-level names such as `control` and `drivers` belong to this project, although python-control uses one too."""

from importlib.metadata import packages_distributions
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.folders import ROOT
from tests.test_layers import HEIGHT


@pytest.mark.parametrize("name", HEIGHT)
def test_the_package_that_is_imported_lies_in_this_repository(name: str) -> None:
    spec = find_spec(name)
    assert spec is not None and spec.origin is not None
    assert Path(spec.origin).resolve() == ROOT / name / "__init__.py"


@pytest.mark.parametrize("name", sorted(HEIGHT.keys() - {"verification"}))
def test_a_type_checker_reads_its_types_where_it_is_installed(name: str) -> None:
    """`mudskipper.replay` returns a record of `logs`, which has some of `estimation`."""
    assert Path(ROOT, name, "py.typed").exists()


def test_no_other_distribution_owns_an_import_name() -> None:
    owners = packages_distributions()
    assert {name: owners[name] for name in HEIGHT if set(owners.get(name, [])) - {"mudskipper"}} == {}
