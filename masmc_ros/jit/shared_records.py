# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Types of records of one lane without the fields of the law, and functions that call their parts.

Records of constant sizes have the same first fields at the same places for all laws. A function
whose arguments have only these fields is compiled once for all laws.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any
import zlib

from masmc_ros.jit.generated import Type
from masmc_ros.jit.sized_records import has_sizes_at_run_time, SHARED, TAG
from numba import types
from numba.core import cgutils
from numba.core.datamodel.manager import DataModelManager
from numba.extending import models, register_model

ir = cgutils.ir


class SharedRecordType(types.Type):
    """
    Type of a record of constant sizes with the fields that `SHARED` counts.

    It is no `types.Record`: Numba would accept a record with more fields in its place. Its symbols
    contain a checksum, because Numba numbers its own records in the order of each process.
    """

    def __init__(self, fields: Iterable[tuple[str, Any]], tags: tuple[str, ...]) -> None:
        """Initialise the type for Numba's fields, and for names of tags."""
        self.fields, self.tags = dict(fields), tags
        places = ((name, str(field.type), field.offset) for name, field in self.fields.items())
        super().__init__(f'SharedRecord({*places, *tags})')

    @property
    def mangling_args(self) -> tuple[str, tuple[int]]:
        """Return the short name of the type in symbols."""
        return 'SharedRecord', (zlib.crc32(self.name.encode()),)

    @property
    def dtype(self) -> SharedRecordType:
        """Return the type, as records of constant sizes do."""
        return self

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of all fields and tags."""
        return (*self.fields, *self.tags)


@register_model(SharedRecordType)
class _SharedRecordModel(models.PrimitiveModel):
    def __init__(self, manager: DataModelManager, kind: SharedRecordType) -> None:
        # A pointer to bytes, as for Numba's records.
        super().__init__(manager, kind, ir.ArrayType(ir.IntType(8), 0).as_pointer())


@cache
def shared_record(record: types.Record) -> SharedRecordType:
    """Return the type of the fields that `SHARED` counts, and of the tags before it."""
    tags = tuple(name for name in record.fields if TAG in name)
    fields = [field for field in record.fields.items() if TAG not in field[0]]
    names = [name.split(TAG)[0] for name in tags]
    # Numba sorts fields of the same place, as those without components, by their names.
    if SHARED in names and len({field.offset for _, field in fields}) == len(fields):
        place = names.index(SHARED)
        fields, tags = fields[:int(tags[place].split(TAG)[1])], tags[:place]
    return SharedRecordType(fields, tags)


def has_one_lane(record: Type) -> bool:
    """Return True for a record of constant sizes with one lane."""
    if not isinstance(record, types.Record | SharedRecordType):
        return False
    first = next(iter(record.fields.values()), None)
    return getattr(getattr(first, 'type', None), 'shape', (0,))[-1] == 1


def calls_large_parts(kinds: Iterable[Type]) -> bool:
    """Return True if a function with these arguments calls the large parts of a tick."""
    return any(
        has_sizes_at_run_time(kind)
        or any(has_one_lane(getattr(kind, name, None)) for name in ('dtype', 'record'))
        or has_one_lane(kind)
        for kind in kinds
    )


def is_large_part(kinds: Iterable[Type]) -> bool:
    """Return True if callers call a large part with these arguments, which have only `shared`."""
    return calls_large_parts(kinds) and not any(
        isinstance(record, types.Record)
        for kind in kinds
        for record in (kind, getattr(kind, 'record', None))
    )
