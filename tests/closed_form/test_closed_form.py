"""The public formulas are functions under `tpd.closed_form`, whatever module has been imported before."""

import importlib
import inspect
import pkgutil

import tpd
import tpd.closed_form
from tpd import paper_scene


def test_every_formula_is_a_function_also_after_its_module_was_imported():
    for module in pkgutil.iter_modules(tpd.closed_form.__path__):
        importlib.import_module(f"tpd.closed_form.{module.name}")
    for name in tpd.closed_form.__all__:
        formula = getattr(tpd.closed_form, name)
        assert inspect.isfunction(formula), name
    p = paper_scene().parameters()
    assert float(tpd.closed_form.uplift(p).margin) < 0.0
