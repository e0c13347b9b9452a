# Copyright 2026 The masmc_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
rcl's walk over the events of a parameter file: node keys, parameter names, values.

rcl does not build a YAML document: it walks over the parser's events with a few flags. So
it accepts some files that look wrong and refuses some that look right, and a file must mean
the same to the offline commands as to the nodes. This is the same walk, state for state.
It differs in two cases. rcl writes past the end of its own arrays for a list right under
`ros__parameters` after a block of more than 128 parameters; here the result is defined. And a
parameter that is written twice has its later value here, whereas rcl keeps one value of every
type and lets a number precede an array.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from masmc_ros.params import node_name
from masmc_ros.params.values import ValueReader, Variant
from masmc_ros.params.yaml_events import c_string, line_of, yaml_events
import yaml

PARAMETERS_KEY = 'ros__parameters'


@dataclass
class Entry:
    """A parameter in a block: its dotted name and the line of its last value (from 1)."""

    name: str
    line: int


@dataclass
class NodeEntries:
    """
    The parameters of one node key, in the order in which rcl numbers them.

    `variants` may have numbers beyond `entries`: a value that stands where rcl does not
    expect one goes to whichever parameter had the turn last, even another node's.
    """

    pattern: str
    line: int
    entries: list[Entry] = field(default_factory=list)
    variants: dict[int, Variant] = field(default_factory=dict)

    def find(self, name: str, line: int) -> int:
        """Return the number of the first parameter of that name, added if there is none."""
        for number, entry in enumerate(self.entries):
            if entry.name == name:
                return number
        self.entries.append(Entry(name, line))
        return len(self.entries) - 1


@dataclass
class _Path:
    """
    Names above the current one, joined, and rcl's count of them.

    The count grows by one a key even where a key brings several names (`/left/controller`,
    `a.b`), and only the last of them goes when the key's map ends.
    """

    separator: str
    text: str | None = None
    count: int = 0

    def add(self, name: str) -> None:
        if self.count == 0 or self.text is None:
            self.text = name
        elif self.text.endswith(self.separator):
            self.text += name
        else:
            self.text += self.separator + name
        self.count += 1

    def remove(self) -> None:
        if self.count == 0:
            return
        self.count -= 1
        if self.count == 0:
            self.text = None
        elif self.text and self.separator in self.text:
            self.text = self.text.rpartition(self.separator)[0]


class BlockReader(ValueReader):
    """The state of rcl's walk over one file."""

    def __init__(self, source: str) -> None:
        """Start at the top of a file; `source` names it in messages."""
        super().__init__(lambda line: f'{source}:{line}')
        self.nodes: list[NodeEntries] = []
        self._node_path = _Path('/')
        self._node_line = 0
        self._name_path = _Path('.')
        self._node: NodeEntries | None = None
        self._number = 0
        self._expects_key = True
        self._in_parameters = False
        self._is_new_map = False
        self._depth = 0

    def read(self, data: bytes) -> list[NodeEntries]:
        """
        Walk over a whole file.

        Returns
        -------
            The blocks in the order in which their node keys first appear.

        Raises
        ------
        InputError
            a file that rcl refuses.

        """
        for event in yaml_events(data, self.place):
            if isinstance(event, yaml.ScalarEvent):
                self._scalar(event)
            elif isinstance(event, yaml.SequenceStartEvent):
                self._sequence_start(event)
            elif isinstance(event, yaml.SequenceEndEvent):
                self.in_array = False
                self._expects_key = True
            elif isinstance(event, yaml.MappingStartEvent):
                self._mapping_start()
            elif isinstance(event, yaml.MappingEndEvent):
                self._mapping_end()
            elif isinstance(event, yaml.AliasEvent):
                self.refuse(
                    line_of(event),
                    f'alias *{event.anchor}: parameter files have no aliases; write the value out',
                )
        return self.nodes

    def _scalar(self, event: yaml.ScalarEvent) -> None:
        if self._expects_key:
            self._key(event)
            self._expects_key = False
            return
        node = self._node
        if not self._in_parameters or node is None or not node.entries:
            self.refuse(
                line_of(event),
                f"value '{c_string(event.value)}' outside of "
                f"{PARAMETERS_KEY}; write 'NODE:', below it '{PARAMETERS_KEY}:' and "
                "below that 'name: value'",
            )
        name = node.entries[self._number].name if self._number < len(node.entries) else 'a map'
        variant = node.variants.setdefault(self._number, Variant())
        if not self.in_array:
            variant.clear()
        self.put(event, variant, name)
        if not self.in_array:
            self._expects_key = True

    def _sequence_start(self, event: yaml.Event) -> None:
        if self._expects_key:
            self.refuse(
                line_of(event),
                'array in the place of a name (or of a second array '
                "in an array); write 'name: [1.0, 2.0]'",
            )
        if not self._in_parameters:
            self.refuse(
                line_of(event),
                f'array outside of {PARAMETERS_KEY}; write the node '
                f"name, below it '{PARAMETERS_KEY}:' and below that the array",
            )
        if not self.in_array and self._node is not None:
            self._node.variants.setdefault(self._number, Variant()).clear()
        self.start_array()

    def _mapping_start(self) -> None:
        self._depth += 1
        self._expects_key = True
        # The map of ros__parameters itself has no name in front of its parameters' names.
        self._is_new_map = not (
            self._in_parameters and self._depth - (self._node_path.count + 1) == 2
        )

    def _mapping_end(self) -> None:
        if self._in_parameters:
            if self._name_path.count > 0:
                self._name_path.remove()
            else:
                self._in_parameters = False
        elif self._depth == self._node_path.count + 1:
            self._node_path.remove()
        self._depth -= 1

    def _key(self, event: yaml.ScalarEvent) -> None:
        key = c_string(event.value)
        line = line_of(event)
        if not event.value:
            self.refuse(line, "no name in front of ':' (or no content); write 'name: value'")
        if self._in_parameters:
            self._parameter_key(key, line)
        elif key.startswith(PARAMETERS_KEY):
            self._parameters_key(line)
        else:
            self._node_path.add(key)
            self._node_line = line

    def _parameters_key(self, line: int) -> None:
        pattern = self._node_path.text
        if pattern is None or self._node_path.count == 0:
            self.refuse(
                line,
                f"{PARAMETERS_KEY} without a node name above it; write 'NODE:' "
                "(or '/**:' for every node) one level up",
            )
        if problem := node_name.complaint(pattern):
            self.refuse(
                self._node_line,
                f"node name '{pattern}': {problem}; write a name such "
                'as controller, /left/controller, /**/controller or /**',
            )
        self._node = self._find_node(pattern)
        self._node_path.remove()
        self._in_parameters = True

    def _find_node(self, pattern: str) -> NodeEntries:
        for node in self.nodes:
            if node.pattern == pattern:
                return node
        self.nodes.append(NodeEntries(pattern, self._node_line))
        return self.nodes[-1]

    def _parameter_key(self, key: str, line: int) -> None:
        node = self._node
        assert node is not None  # set before the walk is inside of parameters
        if self._is_new_map:
            if self._number >= len(node.entries):
                self.refuse(line, f"map '{key}' without a name; write 'name:' one level up")
            # What was just taken for a parameter is the first part of a dotted name.
            self._name_path.text = node.entries[self._number].name
            self._name_path.count += 1
            self._is_new_map = False
        prefix = self._name_path.text
        if prefix is None:
            self._number = node.find(key, line)
            node.entries[self._number].line = line
            return
        self._number = node.find(prefix, line)
        entry = node.entries[self._number]
        entry.name, entry.line = f'{prefix}.{key}', line
