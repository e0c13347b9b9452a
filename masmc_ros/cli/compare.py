# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""`masmc compare`: laws on the same scenario and seeds, and what breaks which."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from masmc_ros.compare.campaign import outcomes, Task
from masmc_ros.compare.contenders import contenders
from masmc_ros.compare.ranking import ranking
from masmc_ros.compare.tables import as_json, page, text
from masmc_ros.compare.trials import trials_named
from masmc_ros.errors import InputError
from masmc_ros.law.command_interface import takes_rates
from masmc_ros.params.scenario import load_scenario
from masmc_ros.report.files import make_folder, whole_file
from masmc_ros.robot.registry import chosen
from masmc_ros.share import scenario_file
from tqdm import tqdm

FILES = ('compare.html', 'compare.txt', 'compare.json')


def compare(
    file: str,
    *,
    laws: str,
    trials: str,
    seeds: int,
    settings: Sequence[str],
    output: str,
    as_data: bool,
) -> int:
    """Compute the runs of all laws in all trials, print the tables and write them."""
    file = scenario_file(file)
    scenario = load_scenario(file, settings)
    if takes_rates(scenario['controller']):
        raise InputError(
            f'{file}: command_interface = velocity: rates are commanded by one law alone; '
            'expected effort'
        )
    mechanism = chosen(scenario['plant'])
    put_through = trials_named(trials)
    tasks = [
        Task(file, tuple(settings), contender, put_through, seeds)
        for contender in contenders(laws, mechanism, scenario['controller']['switching'])
    ]
    folder = Path(output)
    make_folder(folder)
    found = [
        outcome
        for outcomes_ in tqdm(outcomes(tasks), total=len(tasks), unit='law', disable=None)
        for outcome in outcomes_
    ]
    ranked = ranking(found, put_through[0].name)
    written = (
        page(ranked, put_through, mechanism.points, Path(file).name),
        text(ranked, put_through, mechanism.points),
        as_json(ranked) + '\n',
    )
    for name, content in zip(FILES, written, strict=True):
        with whole_file(folder / name) as stream:
            stream.write(content.encode())
    print(written[2 if as_data else 1], end='')
    if not as_data:
        print(f'\nreport: {folder}/ ({", ".join(FILES)})')
    return 0
