"""Small wrong changes of a source file, one at a time, for `tests/mutants.py`.

A mutant is a place in the syntax tree and what stands there instead. Left alone is what no test of
behaviour can see: annotations, decorators, imports, texts, and whatever stands after `raise`.
"""

import ast
import copy
from typing import NamedTuple

OTHER = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.And: ast.Or,
    ast.Or: ast.And,
}
OPPOSITE = {
    ast.Lt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
}
BOUNDARY = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}
UNSEEN = {"annotation", "returns", "decorator_list", "type_params", "ctx"}
WITHOUT_ORDER = {"min", "max", "hypot", "isclose", "array_equal", "zip"}


class Mutant(NamedTuple):
    line: int
    statement: int
    """First line of the statement, by which coverage knows what stands on lines of no code."""
    was: str
    now: str
    tree: ast.Module
    """The whole file with the change; line numbers are those of the file."""


def places(node):
    """(parent, field, index in a list or None, node) of all that may be changed below `node`."""
    for field, value in ast.iter_fields(node):
        if field in UNSEEN:
            continue
        for index, child in enumerate(value) if isinstance(value, list) else [(None, value)]:
            if isinstance(child, ast.AST) and not left_alone(child):
                yield node, field, index, child
                yield from places(child)


def left_alone(node):
    """Whether nothing in here is behaviour."""
    return isinstance(node, (ast.JoinedStr, ast.Raise, ast.Import, ast.ImportFrom)) or (
        isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
    )


def changes(node):
    """What may stand instead of `node`."""
    match node:
        case ast.BinOp(op=op) | ast.BoolOp(op=op) | ast.AugAssign(op=op) if type(op) in OTHER:
            yield with_(node, op=OTHER[type(op)]())
        case ast.UnaryOp(op=ast.USub() | ast.Not()):
            yield node.operand
        case ast.Compare(ops=[op], left=left, comparators=[right]):
            for table in (OPPOSITE, BOUNDARY):
                if type(op) in table:
                    yield ast.Compare(left, [table[type(op)]()], [right])
        case ast.Constant(value=bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(value=int(value)):
            yield ast.Constant(value + 1)
            yield (
                ast.UnaryOp(ast.USub(), ast.Constant(1)) if value == 0 else ast.Constant(value - 1)
            )
        case ast.Constant(value=float(value)):
            yield ast.Constant(2.0 * value or 1.0)
        case ast.Call(func=func, args=args) if name(func) not in WITHOUT_ORDER:
            for i, (a, b) in enumerate(zip(args, args[1:])):
                if ast.dump(a) != ast.dump(b) and not isinstance(a, ast.Starred):
                    yield with_(node, args=[*args[:i], b, a, *args[i + 2 :]])
    if updates(node):
        yield ast.Pass()


def updates(statement):
    """Whether a statement changes what was there before, so that it can be left out."""
    match statement:
        case ast.AugAssign() | ast.Expr(value=ast.Call()):
            return True
        case ast.Assign(targets=[target]):
            return isinstance(target, (ast.Subscript, ast.Attribute))
    return False


def with_(node, **fields):
    """The node with other values of these fields."""
    changed = copy.copy(node)
    for field, value in fields.items():
        setattr(changed, field, value)
    return changed


def name(function):
    """The last word of what is called."""
    return getattr(function, "attr", getattr(function, "id", ""))


def count(text):
    """How many mutants a source text has."""
    return sum(1 for *_, node in places(ast.parse(text)) for _ in changes(node))


def mutant(text, number):
    """The mutant of a source text that has this number."""
    tree = ast.parse(text)
    for parent, field, index, node in places(tree):
        for change in changes(node):
            if number == 0:
                was, now = ast.unparse(node), ast.unparse(change)
                put(parent, field, index, ast.copy_location(change, node))
                return Mutant(
                    node.lineno, statement(tree, node), was, now, ast.fix_missing_locations(tree)
                )
            number -= 1
    raise IndexError("no such mutant")


def statement(tree, node):
    """First line of the innermost statement around a node."""
    return max(
        each.lineno
        for each in ast.walk(tree)
        if isinstance(each, ast.stmt) and each.lineno <= node.lineno <= each.end_lineno
    )


def put(parent, field, index, node):
    """Set a child of a node."""
    if index is None:
        setattr(parent, field, node)
    else:
        getattr(parent, field)[index] = node
