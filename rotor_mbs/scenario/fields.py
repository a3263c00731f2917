"""The kinds of value a scene file holds, as pydantic types, and how a fault is raised. Knows no key.

Importing this module costs 0.2 s (pydantic): it is imported only when a scene is loaded.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo
from pydantic_core import PydanticCustomError

from rotor_mbs.scenario.expression import ALLOWED, ExpressionError, evaluate

MAX_NUMBER = 1e300
MAX_TEXT = 200  # characters
_UNPRINTABLE = ("Cc", "Cf", "Cs", "Zl", "Zp")  # Unicode categories: controls, direction marks, line ends


@dataclass(slots=True)
class Known:
    """What is settled while a file is validated, for the checks of what comes after; empty where that part is faulty.

    bare_pitches: indices of the blades whose pitch has no inertia and is left out of the model
    """

    blades: int | None = None
    wants_tip: bool = False
    bare_pitches: tuple[int, ...] = ()


class Table(BaseModel):
    """A table of the file: exact types, no key but its fields."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


def known(info: ValidationInfo) -> Known:
    assert isinstance(info.context, Known), "a scene is validated with Known() as context"
    return info.context


def fault(wrong: str, allowed: str | None = None) -> PydanticCustomError:
    """An error in plain words: `{shown}` stands for the value; `allowed` defaults to the field's description."""
    return PydanticCustomError("fault", "{wrong}", {"wrong": wrong, "allowed": allowed})


def counted(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def blades_named(indices: Iterable[int]) -> str:
    numbers = [str(i + 1) for i in indices]
    if len(numbers) > 5:
        return f"{len(numbers)} blades (number {numbers[0]} first)"
    return f"blade {numbers[0]}" if len(numbers) == 1 else f"blades {', '.join(numbers)}"


def _double(value: object) -> float:
    if isinstance(value, str):
        try:
            value = evaluate(value)
        except ExpressionError as error:
            raise fault(f"{{shown}}: {error.wrong}", f"in quotes {ALLOWED}") from error
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise fault("{shown} is no number")
    if not abs(value) <= MAX_NUMBER:  # so written that NaN fails, too
        raise fault("{shown} is out of range", f"finite numbers, |x| <= {MAX_NUMBER:g}")
    return float(value)


def _line(value: str) -> str:
    if not value.strip():
        raise fault("is empty")
    if len(value) > MAX_TEXT:
        raise fault(f"is {len(value)} characters long")
    odd = next((char for char in value if unicodedata.category(char) in _UNPRINTABLE), None)
    if odd is not None:
        raise fault(f"holds the control character {odd!a}")
    return value


def _as_list(value: object) -> object:
    return value if isinstance(value, list) else [value]


Number = Annotated[float, BeforeValidator(_double)]
Vector = Annotated[list[Number], Field(min_length=3, max_length=3)]
PerBlade = Annotated[list[Annotated[Number, Field(ge=0)]], BeforeValidator(_as_list)]
Line = Annotated[str, AfterValidator(_line)]
