"""The table of equations in the docstring of `tpd`: every equation has a row with functions that exist.

The tests of each module compare its functions with the equations.
"""

import inspect
import pkgutil
import re
from importlib import import_module
from operator import attrgetter

import tpd

ROWS = re.findall(r"^\| ([^|]+) \| [^|]+ \| (\w+/\w+): ([\w., ]+) \|$", tpd.__doc__ or "", re.MULTILINE)


def test_every_equation_has_a_row():
    numbers = " ".join(equation for equation, _, _ in ROWS)
    named = {int(n) for n in re.findall(r"\((\d+)\)", numbers)}
    for first, last in re.findall(r"\((\d+)\) to \((\d+)\)", numbers):
        named |= set(range(int(first), int(last) + 1))
    # (1) to (3) lead to (4), (8) and (15) are starts of (9) and (16).
    assert named | {15} == set(range(4, 28))


def test_every_function_of_a_row_is_defined_in_its_module():
    assert len(ROWS) >= 12
    for _, place, names in ROWS:
        module = import_module(f"tpd.{place.replace('/', '.')}")
        for name in names.split(", "):
            found = attrgetter(name)(module)
            assert isinstance(found, property) or found.__module__ == module.__name__, name


def test_every_public_formula_is_a_function_after_its_module_is_imported():
    for module in pkgutil.iter_modules(tpd.theory.__path__):
        import_module(f"tpd.theory.{module.name}")
    assert all(inspect.isfunction(getattr(tpd.theory, name)) for name in tpd.theory.__all__)
