# SPDX-License-Identifier: Apache-2.0
"""One parameter file and the command line's settings, as the values of every node."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from masmc_ros.errors import InputError, suggestion
from masmc_ros.nodes.parameters import accepted, declared, is_from_rcl, NODES, SHARED
from masmc_ros.params.declaration import check_all
from masmc_ros.params.file import parse_value, read

Values = dict[str, Any]


def load_scenario(path: str, settings: Iterable[str] = ()) -> dict[str, Values]:
    """Read a parameter file as the nodes would, settings on top, defaults below.

    `settings` are NAME=VALUE as on the command line, NAME being NODE.parameter or a shared
    one, which then holds for every node. Returns checked values by node name. Raises
    InputError for what a node would refuse.
    """
    file = read(path)
    extra = _settings(settings)
    scenario = {}
    for node in NODES:
        given = {n: v for n, v in file.for_node(node).items() if not is_from_rcl(n)}
        places = file.places(node)
        for name in accepted(node) & given.keys():
            # Shared parameters are checked where they stand, needed by this node or not.
            _check_shared(name, given.pop(name), places[name])
        values = check_all(declared(node), given, places)
        names = {parameter.name: parameter for parameter in declared(node)}
        for name, value in extra[node].items():
            values[name] = names[name].check(value, integers_for_doubles=True)
        scenario[node] = values
    return scenario


def strays(path: str) -> list[str]:
    """Return one line for each block of the file that is for none of this package's nodes."""
    return [
        f"{path}:{block.line}: block '{block.pattern}' is for none of {', '.join(NODES)}"
        for block in read(path).unmatched(NODES)
    ]


def _check_shared(name: str, value: Any, place: str) -> None:
    parameter = next(p for p in SHARED if p.name == name)
    check_all([parameter], {name: value}, place)


def _settings(settings: Iterable[str]) -> dict[str, Values]:
    """Sort NAME=VALUE settings by node."""
    sorted_: dict[str, Values] = {node: {} for node in NODES}
    shared = {parameter.name for parameter in SHARED}
    for setting in settings:
        name, equals, text = setting.partition('=')
        if not equals:
            raise InputError(f"--set {setting}: expected NAME=VALUE, as in controller.k_s1=150")
        value = parse_value(text, f'--set {setting}')
        node, _, parameter = name.partition('.')
        if name in shared:
            for each in NODES:
                if name not in accepted(each):
                    sorted_[each][name] = value
        elif node in NODES:
            known = [p.name for p in declared(node)]
            if parameter not in known:
                raise InputError(
                    f"--set {setting}: {node} has no parameter '{parameter}'; "
                    f'{suggestion(parameter, known)}'
                )
            sorted_[node][parameter] = value
        else:
            known = [*shared, *(f'{n}.{p.name}' for n in NODES for p in declared(n))]
            hint = suggestion(name, known)
            if not hint.startswith('did'):
                hint = f'write NODE.parameter with a node of {", ".join(NODES)}'
            raise InputError(f"--set {setting}: unknown parameter '{name}'; {hint}")
    return sorted_
