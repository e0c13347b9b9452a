# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Parser of a report's HTML page."""

from __future__ import annotations

import base64
from dataclasses import dataclass, field
from html.parser import HTMLParser
import json
from typing import Any
import zlib

import numpy as np

VOID = frozenset(('meta', 'br', 'link', 'img'))
ADDRESSES = frozenset(('src', 'href', 'action', 'data', 'poster', 'srcset', 'formaction'))


@dataclass
class Element:
    """HTML element: name, attributes, and text and elements within at any depth."""

    tag: str
    attributes: dict[str, str]
    text: str = ''
    within: list[Element] = field(default_factory=list)

    def find_all(self, tag: str, **attributes: str) -> list[Element]:
        """Return all elements within that have a name and these attributes."""
        return [
            e for e in self.within if e.tag == tag and attributes.items() <= e.attributes.items()
        ]


class Page(HTMLParser):
    """Parsed page; raises AssertionError if elements are not nested."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.root = Element('', {})
        self._open = [self.root]
        self.feed(html)
        self.close()
        assert [e.tag for e in self._open] == ['']

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        element = Element(tag, {name: value or '' for name, value in attrs})
        for outer in self._open:
            outer.within.append(element)
        if tag not in VOID:
            self._open.append(element)

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop().tag == tag

    def handle_data(self, data: str) -> None:
        for outer in self._open:
            outer.text += data

    def addresses(self) -> list[str]:
        """Return all addresses in attributes of elements."""
        return [
            value
            for element in self.root.within
            for name, value in element.attributes.items()
            if name in ADDRESSES
        ]

    def table(self, **attributes: str) -> list[list[str]]:
        """Return the texts of a table's cells by row."""
        (table,) = self.root.find_all('table', **attributes)
        return [
            [cell.text for cell in row.within if cell.tag in ('th', 'td')]
            for row in table.find_all('tr')
        ]

    def figure(self, name: str) -> dict[str, Any]:
        """Return the data and layout of a plot."""
        (data,) = self.root.find_all('script', id=f'{name}-data')
        figure: dict[str, Any] = json.loads(data.text)
        return figure

    def figures(self) -> list[str]:
        """Return the names of all plots."""
        return [e.attributes['id'] for e in self.root.find_all('div') if is_plot(e)]


def is_plot(element: Element) -> bool:
    """Return True if an element contains a plot."""
    return 'plot' in element.attributes.get('class', '').split()


def numbers(values: Any) -> np.ndarray:
    """Return the numbers of a trace that plotly writes as base64 or as a list."""
    if isinstance(values, dict):
        return np.frombuffer(base64.b64decode(values['bdata']), np.dtype(values['dtype']))
    return np.asarray(values, dtype=float)


def lines(figure: dict[str, Any]) -> dict[str, dict[str, np.ndarray]]:
    """Return the samples of every line in the page: times in s, and float32 values."""
    is_over_time = 'range' in figure['layout']['xaxis']
    return {
        trace['name']: {
            key: unpacked(text, is_times=is_over_time and key == 'x')
            for key, text in trace['meta']['samples'].items()
        }
        for trace in figure['data']
        if trace['mode'] == 'lines'
    }


def unpacked(text: str, *, is_times: bool = False) -> np.ndarray:
    """Return the decoded samples: cumulative sums of compressed differences."""
    planes = np.frombuffer(zlib.decompress(base64.b64decode(text)), np.uint8)
    size = 8 if is_times else 4
    whole = np.ascontiguousarray(planes.reshape(size, -1).T)
    if is_times:
        return np.cumsum(whole.view('<f8').ravel()) / 1e9
    return np.cumsum(whole.view('<i4').ravel(), dtype=np.int32).view(np.float32)
