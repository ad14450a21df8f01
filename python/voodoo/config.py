"""The parameters of the tracker: one schema, defined in the core, validated and documented here.

Editors and type checkers see its fields in _config_fields.pyi, which scripts/config_stub.py makes from the same schema.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, create_model

import voodoo._core as _core
from voodoo.errors import ConfigError, naming
from voodoo.model.joint import valid
from voodoo.model.toml_io import parse_toml, read_text

_FIELDS = {name: row for name, *row in _core.config_fields()}


def _annotation(default: object, limits: tuple[float, float] | None, words: list[str]) -> Any:  # noqa: ANN401 - a type form
    if words:
        return Literal[tuple(words)]
    if limits is None:
        return type(default)
    return Annotated[type(default), Field(ge=limits[0], le=limits[1])]


class _Base(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=False, allow_inf_nan=False)

    def __init__(self, **values: Any) -> None:  # noqa: ANN401 - validated below
        with valid("Config", ConfigError, known=_FIELDS):
            super().__init__(**values)


if TYPE_CHECKING:
    from voodoo._config_fields import ConfigFields
else:
    ConfigFields = create_model(
        "ConfigFields",
        __base__=_Base,
        **{name: (_annotation(row[2], row[3], row[4]), row[2]) for name, row in _FIELDS.items()},
    )


class Config(ConfigFields, frozen=True):
    """Frozen parameters of a tracker, given by keyword; `Config().to_toml()` explains every one.

    Raises:
        ConfigError: unknown key, wrong type or out of range; it names the key.
    """

    @classmethod
    def from_toml(cls, text: str, *, source: str = "configuration") -> Config:
        """A configuration from TOML text; missing keys keep their defaults."""
        values = parse_toml(text, source=source, error=ConfigError)
        with naming(source, ConfigError):
            return cls(**values)

    @classmethod
    def load(cls, path: str | Path) -> Config:
        """A configuration from a TOML file.

        Raises:
            ConfigError: it cannot be read, or a key is wrong; it names the file.
        """
        return cls.from_toml(read_text(path, error=ConfigError), source=str(path))

    def to_toml(self) -> str:
        """The configuration as TOML, each entry with its meaning, unit and range."""
        from tomlkit import item

        blocks = ["# Configuration of the voodoo tracker. Lengths in meters, times in seconds, angles in radians."]
        for name, (doc, unit, _, limits, words) in _FIELDS.items():
            facts = [f"unit: {unit}"] if unit else []
            if limits:
                facts.append(f"range: {limits[0]:g} to {limits[1]:g}")
            if words:
                facts.append("one of: " + ", ".join(words))
            notes = [*doc.splitlines(), *([f"({'; '.join(facts)})"] if facts else [])]
            entry = f"{name} = {item(getattr(self, name)).as_string()}"
            blocks.append("\n".join([*(f"# {line}" for line in notes), entry]))
        return "\n\n".join(blocks) + "\n"

    @classmethod
    def words(cls, key: str) -> tuple[str, ...]:
        """The words that an entry can be; empty if it is a number, a switch, or unknown."""
        return tuple(_FIELDS[key][4]) if key in _FIELDS else ()

    def values(self) -> dict[str, float | int | bool | str]:
        """Plain values by key."""
        return dict(self.model_dump())
