"""The public formulas are functions under `tpd.theory`, whatever module has been imported before."""

import importlib
import inspect
import pkgutil

import tpd
import tpd.theory
from tpd import paper_scene


def test_every_formula_is_a_function_also_after_its_module_was_imported():
    for module in pkgutil.iter_modules(tpd.theory.__path__):
        importlib.import_module(f"tpd.theory.{module.name}")
    for name in tpd.theory.__all__:
        formula = getattr(tpd.theory, name)
        assert inspect.isfunction(formula), name
    p = paper_scene().parameters()
    assert float(tpd.theory.uplift(p).margin) < 0.0
