"""Changes of a function's syntax tree that take a guard out of it.

A mutation is found by names, of a status, a variable or an argument, and not by the text of a line. One that
finds nothing to change is an error, so that a guard that was moved or renamed is noticed.
"""

from __future__ import annotations

import ast
from collections.abc import Callable

Mutation = Callable[[ast.AST], ast.AST | None]
"""Replacement of one node; the node itself where there is nothing to change, None to delete a statement."""


def mutated(source: str, function: str, mutation: Mutation) -> str:
    """Source of a module with one function changed, comments lost.

    Args:
        source: of the whole module.
        function: its name, that of a method after the class and a dot.
        mutation: is applied to every node within the function.

    Raises:
        ValueError: no such function, or nothing in it to change.
    """
    tree = ast.parse(source)
    before = ast.unparse(tree)
    _Each(mutation).visit(_named(tree, function))
    after = ast.unparse(ast.fix_missing_locations(tree))
    if after == before:
        raise ValueError(f"the guard in {function} was not found")
    return after


class _Each(ast.NodeTransformer):
    """Applies a mutation to every node, the innermost first."""

    def __init__(self, mutation: Mutation) -> None:
        self.mutation = mutation

    def visit(self, node: ast.AST) -> ast.AST | None:
        """Node with what is within it changed, then itself."""
        return self.mutation(self.generic_visit(node))


def _named(tree: ast.Module, function: str) -> ast.AST:
    here: ast.AST = tree
    for name in function.split("."):
        kinds = (ast.FunctionDef, ast.ClassDef)
        found = [n for n in ast.iter_child_nodes(here) if isinstance(n, kinds) and n.name == name]
        if not found:
            raise ValueError(f"there is no function {function}")
        here = found[0]
    return here


def _mentions(node: ast.AST, name: str) -> bool:
    return any(name in (getattr(n, "id", ""), getattr(n, "attr", "")) for n in ast.walk(node))


def _is_where(node: ast.AST) -> bool:
    """Whether a node is a call `where(condition, a, b)`, of a module or of a local name."""
    if not (isinstance(node, ast.Call) and len(node.args) == 3):
        return False
    return "where" in (getattr(node.func, "attr", ""), getattr(node.func, "id", ""))


def _gives(node: ast.AST, status: str) -> bool:
    """Whether a node is a status by its name: an attribute, a text, a call with the text, a number's name."""
    if isinstance(node, ast.Call) and len(node.args) == 1:
        node = node.args[0]
    return status in (getattr(node, name, None) for name in ("attr", "value", "id"))


def _within_assignment(variable: str, mutation: Mutation) -> Mutation:
    """Mutation of what is assigned to a variable."""

    def change(node: ast.AST) -> ast.AST | None:
        if isinstance(node, ast.Assign):
            names = (n for t in node.targets for n in ast.walk(t) if isinstance(n, ast.Name))
            if any(n.id == variable for n in names):
                return _Each(mutation).visit(node)
        return node

    return change


def never(status: str) -> Mutation:
    """`where(condition, a, b)`, or `a if condition else b`, no longer gives this status but the other one of
    the two."""

    def change(node: ast.AST) -> ast.AST:
        choices: tuple[ast.expr, ...] = ()
        if isinstance(node, ast.Call) and _is_where(node):
            choices = node.args[1], node.args[2]
        if isinstance(node, ast.IfExp):
            choices = node.body, node.orelse
        for this, other in (choices, choices[::-1]) if choices else ():
            if _gives(this, status):
                return other
        return node

    return change


def without_term(variable: str, term: str) -> Mutation:
    """The condition assigned to a variable loses the operand of `&` that mentions a name."""

    def change(node: ast.AST) -> ast.AST:
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitAnd):
            if _mentions(node.right, term):
                return node.left
            if _mentions(node.left, term) and not isinstance(node.left, ast.BinOp):
                return node.right
        return node

    return _within_assignment(variable, change)


def without_nan(variable: str) -> Mutation:
    """`where(condition, x, y)` assigned to a variable, with NaN in y, becomes x."""

    def change(node: ast.AST) -> ast.AST:
        found = isinstance(node, ast.Call) and _is_where(node) and _mentions(node.args[2], "nan")
        return node.args[1] if found else node

    return _within_assignment(variable, change)


def nothing_true(name: str) -> Mutation:
    """Comparisons that mention a name are false."""

    def change(node: ast.AST) -> ast.AST:
        found = isinstance(node, ast.Compare) and _mentions(node, name)
        return ast.BinOp(node, ast.BitAnd(), ast.Constant(False)) if found else node

    return change


def unchecked(name: str) -> Mutation:
    """Calls of a check whose first argument is this name are left out."""

    def change(node: ast.AST) -> ast.AST | None:
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call) and node.value.args:
            return None if getattr(node.value.args[0], "value", None) == name else node
        return node

    return change


def unrefused(error: str) -> Mutation:
    """`raise` of this error becomes `pass`."""

    def change(node: ast.AST) -> ast.AST:
        return ast.Pass() if isinstance(node, ast.Raise) and _mentions(node, error) else node

    return change


def constant(name: str, value: float) -> Mutation:
    """A name that is read becomes a number."""

    def change(node: ast.AST) -> ast.AST:
        read = isinstance(node, ast.Name) and node.id == name and isinstance(node.ctx, ast.Load)
        return ast.Constant(value) if read else node

    return change
