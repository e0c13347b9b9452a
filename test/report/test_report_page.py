# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Report page: contents, and independence of external resources."""

from __future__ import annotations

import base64
from dataclasses import replace
import gzip
from pathlib import Path
import re
from typing import Any

from helpers.logged_runs import ARRAY, STATE, write_run
from helpers.logged_runs import numbers as numbers_of_a_run
from helpers.report_html import lines, numbers, Page, unpacked
from helpers.report_runs import (
    later,
    none,
    paper_like,
    run_of,
    series,
    telling,
    ticks,
    with_change,
    without_error,
)
from helpers.small_tree import parameters as tree_parameters
from masmc_ros.cli.main import main
from masmc_ros.log.read.reader import Run
from masmc_ros.log.write.writer import LogWriter
from masmc_ros.messages.commands import ArmVelocityCdr
from masmc_ros.messages.joint_state import JointStateCdr
from masmc_ros.messages.platform_messages import TwistCdr
from masmc_ros.messages.topics import TWIST
from masmc_ros.report.digest import digests_of
from masmc_ros.report.measure.labels import labels
from masmc_ros.report.measure.metrics import metrics
from masmc_ros.report.measure.parameters import run_robot
from masmc_ros.report.measure.tracking import tracking
from masmc_ros.report.page.page import report_page
from masmc_ros.robot.mechanisms import joint_names_of, mechanism_from
import numpy as np
import pytest

NETWORK = re.compile(r'(?:https?:)?//[\w.-]+\.\w+', re.IGNORECASE)
TIMES = ticks()


def html(*runs: Run) -> str:
    """Return the report of runs."""
    return report_page(labels(runs), digests_of(runs), range(len(runs)))


def page(*runs: Run) -> Page:
    """Return the report of runs, parsed."""
    return Page(html(*runs))


def with_telemetry(run: Run) -> Run:
    """Return a run with surface and estimates at every second state."""
    random = np.random.default_rng(7)
    times = run.times[::2]
    return telling(
        run,
        surface=(times, random.standard_normal((len(times), 4))),
        estimate=(times, random.standard_normal((len(times), 7))),
    )


@pytest.fixture(scope='module')
def changed() -> Run:
    run = with_telemetry(paper_like('a.mcap', k_s1=100.0))
    run = with_change(run, 5.0, '/left/controller', k_s1=[1.0, 2.0, 3.0, 4.0], sigma=4.0)
    return with_change(run, 12.34, 'controller', k_s1=150.0)


@pytest.fixture(scope='module')
def both(changed: Run) -> Page:
    return page(changed, paper_like('b.mcap', law='rasmc', scale=0.5))


def test_report_page_has_no_external_references(both: Page) -> None:
    assert both.addresses()
    assert all(address.startswith('#') for address in both.addresses())
    scripts = [e for e in both.root.find_all('script') if 'type' not in e.attributes]
    assert len(scripts) == 1
    assert not any('src' in e.attributes for e in both.root.find_all('script'))
    assert not both.root.find_all('link')
    (style,) = both.root.find_all('style')
    assert 'url(' not in style.text
    assert '@import' not in style.text
    # plotly's script contains addresses for unused functions: the policy forbids them.
    (plotly,) = both.root.find_all('script', id='plotly')
    assert 'plotly.js v' in gzip.decompress(base64.b64decode(plotly.text)).decode()
    assert not NETWORK.findall(both.root.text)
    (policy,) = both.root.find_all('meta', **{'http-equiv': 'Content-Security-Policy'})
    rules = dict(rule.split(maxsplit=1) for rule in policy.attributes['content'].split('; '))
    assert rules.pop('default-src') == "'none'"
    assert not any(NETWORK.search(rule) or '*' in rule for rule in rules.values())


def test_report_page_internal_links_have_targets(both: Page) -> None:
    names = [e.attributes['id'] for e in both.root.within if 'id' in e.attributes]
    assert len(set(names)) == len(names)
    assert {address[1:] for address in both.addresses()} <= set(names)
    labels_used = {
        e.attributes['aria-labelledby']
        for e in both.root.within
        if 'aria-labelledby' in e.attributes
    }
    assert labels_used <= set(names)


def test_report_page_plots_have_titles_and_units(both: Page) -> None:
    assert len(both.figures()) == 4 + 6 + 4
    for name in both.figures():
        (title,) = both.root.find_all('figcaption', id=f'{name}-title')
        assert title.text
        layout = both.figure(name)['layout']
        texts = [layout[axis]['title']['text'] for axis in ('xaxis', 'yaxis')]
        units = re.findall(r'\((mm|m|s|m/s|N·m)\)', ' '.join(texts))
        assert len(units) == (1 if name.endswith('estimate') else 2), texts
        traces = both.figure(name)['data']
        if name.endswith('estimate'):
            assert all(re.search(r'\(kg(·m²?)?\)$', trace['name']) for trace in traces[:7])
        solid = [t for t in traces if t['mode'] == 'lines']
        drawn = [(t['meta']['colour'], t['line'].get('dash')) for t in solid]
        assert len(set(drawn)) == len(drawn)


def test_report_page_time_axes_have_equal_range(both: Page) -> None:
    plots = both.root.find_all('div', **{'class': 'plot over-time'})
    over_time = [plot.attributes['id'] for plot in plots]
    assert len(over_time) == len(both.figures()) - 2
    for name in over_time:
        assert both.figure(name)['layout']['xaxis']['range'] == [0.0, 20.0]


def test_report_page_table_has_every_run_and_metric(both: Page, changed: Run) -> None:
    head, first, second = both.table(id='metrics')
    assert head[:3] == ['run', 'window (s)', 'E RMS (mm)']
    assert (first[0], second[0]) == ('smc, tanh δ 0.2, changed', 'rasmc, tanh δ 0.2')
    rms = metrics(changed).of('end_effector').rms
    assert rms is not None
    assert float(first[2]) == pytest.approx(1e3 * rms, rel=5e-3)
    settles = first[head.index('E settles (s)')]
    settled = metrics(changed).of('end_effector').settling
    assert float(settles) == pytest.approx(settled or 0.0, rel=5e-3)
    assert first[head.index('F settles (s)')] == 'does not'


@pytest.mark.parametrize(
    ('name', 'signal', 'scale'),
    [
        ('error_E', 'error', 1e3),
        ('error_F', 'error', 1e3),
        ('surface', 'surface', 1.0),
        ('torque', '', 1.0),
        ('estimate', 'estimate', 1.0),
    ],
)
def test_report_page_plots_equal_log(
    both: Page, changed: Run, name: str, signal: str, scale: float
) -> None:
    drawn = list(lines(both.figure(f'run-1-{name}')).values())
    series = changed.telemetry.get(signal, changed.torque)
    columns = series.values.T
    columns = {'error_E': columns[:2], 'error_F': columns[2:]}.get(name, columns)
    assert len(drawn) == len(columns)
    for samples, values in zip(drawn, columns, strict=True):
        np.testing.assert_array_equal(samples['x'], series.times)
        np.testing.assert_array_equal(samples['y'], (values * scale).astype(np.float32))


def test_report_page_path_plot_shows_both_points(both: Page, changed: Run) -> None:
    tracked = tracking(changed)
    traces = lines(both.figure('run-1-path'))
    for name, values, first in (
        ('E actual', tracked.actual, 0),
        ('E desired', tracked.desired, 0),
        ('F actual', tracked.actual, 2),
        ('F desired', tracked.desired, 2),
    ):
        assert values is not None
        samples = traces.pop(name)
        for axis, column in zip('xy', values[:, first:first + 2].T, strict=True):
            np.testing.assert_array_equal(samples[axis], column.astype(np.float32))
    assert not traces
    layout = both.figure('run-1-path')['layout']
    assert layout['yaxis']['scaleanchor'] == 'x'  # equal scales of x and y


def test_report_page_replay_has_outlines_of_robot(both: Page, changed: Run) -> None:
    robot = both.figure('run-1-path')['layout']['meta']['robot']
    times, (kinds, sizes) = robot['times'], zip(*robot['parts'], strict=True)
    assert (times[0], times[-1], len(times)) == (0.0, 20.0, 200)
    assert kinds == ('body', 'part', 'part', 'links')
    points = unpacked(robot['points']).reshape(-1, 2, len(times))
    assert len(points) == sum(sizes)
    known = run_robot(changed)
    assert known is not None
    place = round(times[70] * 100.0)
    shapes = known.mechanism.formulas.outline(known.geometry, changed.position[place]).shapes
    expected = np.concatenate([shape.points for shape in shapes])
    np.testing.assert_allclose(points[:, :, 70], expected, atol=1e-6)


def test_report_page_changes_are_marked_in_time_plots(both: Page) -> None:
    for name in both.figures():
        figure = both.figure(name)
        marks = [t for t in figure['data'] if t['mode'] != 'lines']
        lines = [shape['x0'] for shape in figure['layout'].get('shapes', ())]
        if not name.startswith('run-1') or name.endswith('path'):
            assert not marks
            assert not lines
            continue
        (mark,) = marks
        assert lines == [5.0, 12.34]
        assert numbers(mark['x']).tolist() == [5.0, 12.34]
        assert mark['text'] == ['k_s1, sigma', 'k_s1']
        assert mark['hovertext'] == [
            'controller k_s1: 100.0 → [1.0, 2.0, 3.0, 4.0]<br>controller sigma: ? → 4.0',
            'controller k_s1: [1.0, 2.0, 3.0, 4.0] → 150.0',
        ]


def test_report_page_tables_list_changes_and_start_values(both: Page) -> None:
    _, *rows = both.table(**{'class': 'changes'})
    assert rows == [
        ['5.000', '500', 'controller', 'k_s1', '100.0', '[1.0, 2.0, 3.0, 4.0]'],
        ['5.000', '500', 'controller', 'sigma', '?', '4.0'],
        ['12.340', '1234', 'controller', 'k_s1', '[1.0, 2.0, 3.0, 4.0]', '150.0'],
    ]
    tables = both.root.find_all('table', **{'class': 'parameters'})
    starts = {
        tuple(cell.text for cell in row.within if cell.tag in ('th', 'td'))
        for row in tables[0].find_all('tr')
    }
    assert ('k_s1', '100.0', '[1.0, 2.0, 3.0, 4.0] from 5.000 s, 150.0 from 12.340 s') in starts
    assert ('law', '"smc"', '') in starts


def test_report_page_changes_are_relative_to_first_state() -> None:
    run = later(paper_like(), 1.7e9)
    figure = page(with_change(run, 5.0, 'controller', k_s1=1.0)).figure('run-1-torque')
    (mark,) = (t for t in figure['data'] if t['mode'] != 'lines')
    assert numbers(mark['x']) == pytest.approx([5.0], abs=1e-6)
    assert next(iter(lines(figure).values()))['x'][-1] == pytest.approx(20.0, abs=1e-6)


def test_report_page_shows_origin_of_log(changed: Run) -> None:
    described = replace(
        changed,
        topics={'/joint_states': 2001, '/odom': 101},
        metadata={'versions': [{'masmc_ros': '9.8.7', 'numpy': '6.5.4'}]},
        attachments={'paper.yaml': b'12345'},
    )
    parsed = page(described)
    _, *rows = parsed.table(**{'class': 'topics'})
    assert rows == [['/joint_states', '2001'], ['/odom', '101']]
    details = [e.text for e in parsed.root.find_all('dd')]
    facts = ['paper.yaml, 20 s', 'masmc_ros 9.8.7']
    assert details == [*facts, 'a.mcap', '9.8.7', '6.5.4', '5 bytes']


BARE: dict[str, Any] = {'parameters': {}, 'reference': None}


@pytest.mark.parametrize(
    ('run', 'plots', 'message'),
    [
        (without_error(paper_like()), ['path', 'error_E', 'error_F', 'torque'], 'computed from'),
        (
            replace(paper_like(), reference=None),
            ['path', 'error_E', 'error_F', 'torque'],
            'No reference: the',
        ),
        (replace(paper_like(), **BARE), ['path', 'error_E', 'error_F', 'torque'], 'No parameters'),
        (replace(without_error(paper_like()), **BARE), ['path', 'torque'], 'No errors: neither'),
        (
            replace(
                without_error(paper_like()),
                torque=none(4),
                **BARE,
            ),
            ['path', 'torque'],
            'No effort_commands',
        ),
    ],
)
def test_report_page_missing_signals_are_named(run: Run, plots: list[str], message: str) -> None:
    parsed = page(run)
    assert [n.removeprefix('run-1-') for n in parsed.figures() if n.startswith('run')] == plots
    (box,) = parsed.root.find_all('div', **{'class': 'missing'})
    assert message in box.text
    for name in plots:
        assert parsed.figure(f'run-1-{name}')['data']


def test_report_page_log_with_states_only_is_complete(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, folder = tmp_path / 'lab.mcap', tmp_path / 'report'
    recorded = numbers_of_a_run(40)
    write_run(log, recorded, '/left/', everything=False)
    assert main(['report', str(log), '--output', str(folder)]) == 0
    assert 'report.html' in capsys.readouterr().out
    parsed = Page((folder / 'report.html').read_text(encoding='utf-8'))
    assert parsed.figures() == ['run-1-path', 'run-1-torque']
    (path,) = lines(parsed.figure('run-1-path')).values()
    np.testing.assert_array_equal(path['x'], recorded.position[:, 0].astype(np.float32))
    wheel = lines(parsed.figure('run-1-torque'))['right wheel']
    np.testing.assert_array_equal(wheel['y'], recorded.effort[:, 3].astype(np.float32))
    assert len(parsed.root.find_all('li')) == 8


def test_report_renamed_topics_prints_expected_names(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, folder = tmp_path / 'base.mcap', tmp_path / 'report'
    state, command = JointStateCdr(), ArmVelocityCdr()
    with LogWriter(log) as writer:
        states = writer.channel('/joint_states', STATE)
        commands = writer.channel('/arm_controller/commands', ARRAY)
        twists = writer.channel('/base/cmd_vel', TWIST)
        for stamp in range(0, 40_000_000, 1_000_000):
            state.set_stamp(stamp)
            command.set_stamp(stamp)
            writer.write(states, stamp, state.to_bytes())
            writer.write(commands, stamp, command.to_bytes())
            writer.write(twists, stamp, TwistCdr().to_bytes())
    assert main(['report', str(log), '--output', str(folder)]) == 0
    (line,) = [text for text in capsys.readouterr().err.splitlines() if 'Not read' in text]
    assert line.startswith(f'{log}: Not read are /arm_controller/commands, /base/cmd_vel:')
    assert 'controller/tracking_error' in line
    assert 'cmd_vel, arm_velocity_commands' in line
    assert line.endswith('next to /joint_states.')
    parsed = Page((folder / 'report.html').read_text(encoding='utf-8'))
    (box,) = parsed.root.find_all('div', **{'class': 'missing'})
    assert 'Not read are /arm_controller/commands' in box.text


def test_report_page_restarted_node_is_named() -> None:
    (box,) = page(replace(paper_like(), restarted=('controller',))).root.find_all(
        'div', **{'class': 'remarks'}
    )
    assert 'controller was restarted' in box.text


def test_report_page_complete_log_has_no_warning(both: Page) -> None:
    boxes = both.root.find_all('div', **{'class': 'missing'})
    assert len(boxes) == 1  # only the second run has no surface and estimates
    assert 'controller/sliding_surface' in boxes[0].text


def tree_run(**commands: Any) -> Run:
    """Return a run of a robot of a URDF, with a prismatic joint, at rest."""
    values = tree_parameters()
    mechanism, times = mechanism_from(values), TIMES[:50]
    joints = len(mechanism.joints)
    own = len(mechanism.own_rates)
    signals = {
        'torque': (times, np.ones((50, joints))), 'cmd_vel': none(2), 'arm_rates': none(own),
        **commands,
    }  # fmt: skip
    return replace(
        run_of(np.ones((50, len(mechanism.axes))), times),
        position=np.zeros((50, len(mechanism.positions))),
        velocity=np.zeros((50, len(mechanism.positions))),
        applied_effort=np.zeros((50, joints)),
        reference=None,
        parameters={},
        mechanism=mechanism,
        joint_names=joint_names_of(mechanism),
        **{
            name: series(*value) if isinstance(value, tuple) else value
            for name, value in signals.items()
        },
    )


def test_report_page_prismatic_joint_has_units_of_force_and_speed() -> None:
    force = page(tree_run())
    names = [trace['name'] for trace in force.figure('run-1-torque')['data']]
    assert names[2:4] == ['turret_joint (N·m)', 'lift_joint (N)']
    titles = [force.figure(name)['layout']['yaxis']['title']['text'] for name in force.figures()]
    assert '<i>|τ|</i> (N·m, N)' in titles
    times = TIMES[:50]
    speed = page(
        tree_run(
            torque=none(7), cmd_vel=(times, np.ones((50, 2))), arm_rates=(times, np.ones((50, 5)))
        )
    )
    names = [trace['name'] for trace in speed.figure('run-1-speed')['data']]
    assert names == ['forward speed', 'lift_joint']


def test_report_page_notes_are_about_its_robots() -> None:
    (note, *_) = page(tree_run()).root.find_all('p', **{'class': 'note'})[1:]
    assert 'all seven commands' in note.text
    assert 'E and F' not in note.text
    (note, *_) = page(paper_like()).root.find_all('p', **{'class': 'note'})[1:]
    assert note.text.startswith('E and F: distance of the end effector')
    assert 'all four commands' in note.text


@pytest.mark.parametrize('count', [1, 2])
def test_report_page_shortest_runs_are_plotted(count: int) -> None:
    run = run_of(np.ones((count, 4)), TIMES[:count])
    assert 'run-1-error_E' in page(run).figures()


def test_report_page_diverged_run_is_plotted() -> None:
    run = paper_like()
    error = run.telemetry['error'].values.copy()
    error[1500:1700], error[1700:] = np.inf, np.nan
    plotted = lines(page(telling(run, error=(run.times, error))).figure('run-1-error_E'))
    for samples, column in zip(plotted.values(), error.T[:2], strict=True):
        np.testing.assert_array_equal(samples['y'], (1e3 * column).astype(np.float32))


EVIL = '</script><script>alert(1)</script><!-- "\' & <b>'


def test_report_page_texts_of_logs_are_escaped() -> None:
    run = replace(paper_like(f'{EVIL.replace("/", "∕")}.mcap', law=EVIL, **{EVIL: EVIL}))
    run = with_change(run, 5.0, EVIL.replace('/', ''), **{EVIL: EVIL})
    run = replace(
        run,
        topics={EVIL: 1},
        metadata={'versions': [{EVIL: EVIL}]},
        attachments={EVIL: b''},
    )
    parsed, plain = page(run), page(with_change(paper_like(), 5.0, 'controller', k_s1=1.0))
    assert len(parsed.root.find_all('script')) == len(plain.root.find_all('script'))
    assert not parsed.root.find_all('b')
    assert EVIL in parsed.root.text
    # plotly also interprets markup in texts.
    for name in parsed.figures():
        for trace in parsed.figure(name)['data']:
            for text in (trace['name'], *trace.get('text', ()), *trace.get('hovertext', ())):
                assert not set(re.findall(r'<(\w+)', text)) - {'sub', 'br'}


@pytest.mark.parametrize(
    'name', ['{{ 7 * 7 }}', '&amp;', '%s {} {0}', '\\u003c', '=cmd', 'δ 机器人']
)
def test_report_page_any_file_name_is_shown(name: str) -> None:
    run = replace(paper_like(f'{name}.mcap'), parameters={})
    assert page(run).table(id='metrics')[1][0] == name


def test_report_page_file_name_without_text_is_shown() -> None:
    """On Linux a name is bytes; Python reads those that are no UTF-8 as surrogates."""
    run = replace(paper_like('bad\udcff.mcap'), parameters={})
    assert page(run).table(id='metrics')[1][0] == 'bad?'
    assert 'bad?.mcap: 2001 states' in page(run).root.text


def test_report_page_equal_runs_give_equal_page(changed: Run) -> None:
    assert html(changed) == html(changed)


def test_report_page_two_long_runs_stay_below_10_mb() -> None:
    t = ticks(20.0, 0.001)
    chatter = np.where(np.arange(len(t)) % 2, 90.0, -90.0)[:, None] * np.ones(4)
    random = np.random.default_rng(3)
    run = with_telemetry(run_of(random.standard_normal((len(t), 4)), t, torque=chatter))
    assert len(html(run, replace(run, path=Path('b.mcap'))).encode()) < 10e6
