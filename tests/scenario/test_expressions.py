"""Quoted arithmetic: what it may hold, that it is Python's float arithmetic, and that nothing else
gets through."""

from __future__ import annotations

import ast
import math

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from rotor_mbs.errors import InputError
from rotor_mbs.scenario.expressions import ALLOWED, MAX_LENGTH, evaluate
from rotor_mbs.scenario.keys import read_number


@pytest.mark.parametrize(
    ("text", "value"),
    [
        (" 2.50 ", 2.5), (".5", 0.5), ("5.", 5.0), ("1E+3", 1e3), ("007", 7.0), ("deg(180)", math.pi),
        ("11*pi/12", 11 * math.pi / 12), ("2**3**2", 512.0), ("+".join("1" * 100), 100.0), ("1e200*1e-200", 1.0),
    ],
)  # fmt: skip
def test_value(text: str, value: float) -> None:
    """What `test_agrees_with_python_to_the_last_bit` does not write: spaces, ways of writing
    numbers, degrees."""
    assert evaluate(text) == value


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("1 2", '"1 2" is not a complete expression'),
        ("abc", '"abc" is not a number or an operation on numbers'),
        ("1 + abc", '"1 + abc": "abc" is not a number or an operation on numbers'),
    ],
)
def test_a_message_has_the_value_once(text: str, problem: str) -> None:
    with pytest.raises(InputError) as raised:
        read_number(text)
    assert problem in str(raised.value)
    assert str(raised.value).count(text) == 1


@pytest.mark.parametrize(
    "text",
    [
        "", "   ", "1e400", "9**9**9**9", "1/0", "(-8)**(1/3)", "sqrt(-1)", "nan", "-inf", "Pi", "٣", "²", "1_000",
        "0x10", "1j", "1 2", "1,2", "1 +", "+1", "*1", "1//2", "7 % 2", "(1", "1)", "()", "sqrt", "sqrt()",
        "hypot(1)", "hypot(1, 2, 3)", "pi(2)", "hypot(1, 2,)", "sqrt(*1)", "1 if 1 else 2", "2pi", "abs(1)",
        "__import__('os')", "(1).__class__", "[1]", "1\n+1", "1 # one", "1;2",
    ],
)  # fmt: skip
def test_refused_with_one_sentence_that_says_what_is_allowed(text: str) -> None:
    with pytest.raises(InputError, match=r"; allowed: ") as caught:
        read_number(text)
    assert str(caught.value).endswith(ALLOWED)
    assert str(caught.value).isprintable()


_CONSTANTS = st.floats(min_value=0, max_value=1e20, allow_subnormal=False).map(
    ast.Constant
) | st.just(ast.Name("pi"))
_OPERATORS = st.sampled_from([ast.Add(), ast.Sub(), ast.Mult(), ast.Div(), ast.Pow()])


def _larger(parts: st.SearchStrategy[ast.expr]) -> st.SearchStrategy[ast.expr]:
    return (
        st.builds(ast.BinOp, parts, _OPERATORS, parts)
        | st.builds(lambda part: ast.UnaryOp(ast.USub(), part), parts)
        | st.builds(lambda part: ast.Call(ast.Name("sqrt"), [part], []), parts)
        | st.builds(lambda x, y: ast.Call(ast.Name("hypot"), [x, y], []), parts, parts)
    )


@given(st.recursive(_CONSTANTS, _larger, max_leaves=8))
def test_agrees_with_python_to_the_last_bit(tree: ast.expr) -> None:
    # `ast.unparse` writes only the brackets that Python's precedence needs, so precedence is tested
    # as well.
    text = ast.unparse(tree)
    assume(len(text) <= MAX_LENGTH)
    try:
        expected = eval(text, {"pi": math.pi, "sqrt": math.sqrt, "hypot": math.hypot})
    except (ArithmeticError, ValueError, TypeError):  # a complex number has no sqrt in `math`
        expected = math.nan
    value, refused = math.nan, ""
    try:
        value = evaluate(text)
    except ValueError as error:
        refused = str(error)
    if not refused:
        assert value.hex() == expected.hex()
    else:  # Python goes on with infinities: 1/(1e300*1e300) is 0 there
        assert "no finite value" in refused
        assert "**" in text or isinstance(expected, complex) or not 1e-200 < abs(expected) < 1e200


@given(st.text() | st.text(alphabet="0123456789.eE+-*/(), pisqrthypot_", max_size=40))
@example("9" * MAX_LENGTH)
@example("\t")
@example("(" * MAX_LENGTH)
@example("-" * (MAX_LENGTH - 1) + "1")
@example("1**" * (MAX_LENGTH // 3) + "1")
@example("sqrt(" * 40 + "1" + ")" * 40)
@example("1" * 10**6)
def test_any_text_is_a_finite_number_or_a_value_error(text: str) -> None:
    message = ""
    try:
        assert math.isfinite(evaluate(text))
    except ValueError as error:
        message = str(error)
    assert message.isprintable()
