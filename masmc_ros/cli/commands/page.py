# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc page`: a page that computes runs of a parameter file in a browser."""

from __future__ import annotations

import argparse
from pathlib import Path
import sys

from masmc_ros.cli.arguments import add_file, add_json, add_overwrite, add_settings
from masmc_ros.cli.compile_notice import compile_notice
from masmc_ros.files import check_absent, make_folder, scenario_file, write_file
from masmc_ros.result_text import json_text


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = (
        'Write a page that computes runs of a parameter file in a browser, without a server: the'
        ' compiled laws and the robot as WebAssembly. Its signals are bitwise those of masmc'
        ' simulate.'
    )
    add_file(parser)
    parser.add_argument(
        '--laws', default='', metavar='LAW,...',
        help='LAW or LAW:SWITCHING, separated by commas; or all (that of the file, and those of'
        ' the paper with switching terms to compare)',
    )  # fmt: skip
    add_settings(parser)
    parser.add_argument(
        '--output', default='page.html', metavar='PAGE.html', help='output file (%(default)s)'
    )
    add_overwrite(parser)
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Write the page, and print its size and laws that it lacks."""
    path = Path(options.output)
    check_absent(path, overwrite=options.overwrite)
    # Imported here: the compiler takes time.
    from masmc_ros.native.page import page_of

    with compile_notice('the laws of the page'):
        page = page_of(scenario_file(options.file), options.set, options.laws, options.file)
    make_folder(path.parent)
    write_file(path, page.html.encode())
    size = path.stat().st_size
    if options.json:
        print(json_text({
            'file': path, 'bytes': size, 'laws': page.laws, 'omitted': page.omitted,
        }))  # fmt: skip
        return 0
    for line in page.omitted:
        print(f'omitted: {line}', file=sys.stderr)
    print(f'{path}: {size} bytes; {", ".join(page.laws)}')
    print(f'Try it: open {path} in a browser')
    return 0
