# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""
Blocks of README.md and docs/ are run, page by page, in a separate folder and ROS domain.

- Python: a block that starts with `# NAME.py` is written to this file and imported; `--controller`
  reads the file. With lines
  `...` it is an excerpt of examples/NAME.py. A block that starts with `# in masmc_ros/NAME.py`
  uses the names of this module. `setup(...)` installs entry points. Other blocks share names.
- YAML: a block that starts with `# NAME.yaml` is written to this file, or appended to it.
- Shell: `masmc` commands, and their equivalents `ros2 run` and `ros2 param`. Simulations are
  shortened, and comparisons have few laws. A node runs until the page ends or starts it again.
  Plain Python computes them and those of URDF robots, with the same bits: compiling them takes
  longer than so few ticks. The demo runs in other tests.
- Console: as shell, and the output must be the documented one; `...` stands for any text.
- Diff: the unchanged and the added lines are in the file that the text names before.

Blocks of files and lines of `masmc_ros/` are those of test_extending.py.

test_documentation_blocks.py checks the other commands.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import redirect_stdout
import importlib
from importlib.metadata import EntryPoint
import io
from itertools import pairwise
from pathlib import Path
import re
import shlex
import shutil
import signal
import subprocess
import sys
import threading

from helpers.child_environment import child_environment, domain, domain_variables
from helpers.command_process import CommandProcess, COMPILING, PATIENCE, run_command, SERVED
from helpers.pages import commands, console, document, page_name, PAGES, ROOT
import pytest
from sybil.example import Example

pytestmark = pytest.mark.slow

FIRST_LINE = re.compile(r'# (\w+\.(?:py|yaml))\b')
INSIDE = re.compile(r'# in masmc_ros/([\w/]+)\.py\b')
SAMPLES = {'tiago.yaml': 'tiago', 'other.mcap': '', 'run.mcap': ''}
"""Files that pages use and do not write, and the configurations they are; others are `paper`."""

TREES = 'my_robot.yaml', 'tiago', 'config/tiago.yaml'
"""Files of URDF robots."""

OTHER_NODES = '/plant', '/trajectory'
"""Nodes other than the controller whose parameters pages change."""

COMPILED = {'excite', 'library', 'page', 'play', 'run', 'warm'}
PLANAR = dict.fromkeys(
    ('config/tiago.yaml', 'config/ur5.yaml', 'my_robot.yaml', 'tiago', 'ur5'), 'config/paper.yaml'
)
"""Commands that compile the code of URDF robots for minutes: pages run them with the planar one.

Tests of identification, of law changes, of the launch files and in test/native run them with URDF
robots.
"""

CAMPAIGNS = ('sweep', 'monte-carlo', 'tune')

SMALLER = {
    '--seeds': '2', '--runs': '2', '--evaluations': '4', '--device': 'cpu', '--trials': 'ideal'
}  # fmt: skip
"""Options of commands that compute many runs, with values that take little time and no GPU."""

INTERPRETED = {'NUMBA_DISABLE_JIT': '1'}
"""Environment of commands that plain Python computes."""

WHOLE = {'run.mcap', '--list', 'excite.yaml'}
"""Arguments of `masmc simulate` whose run is not shortened."""


class PageRun:
    """
    Folder, names and nodes of a page whose blocks are run in their order.

    Parameters
    ----------
    folder
        Empty folder.
    log
        Log of the paper's experiment.
    variables
        Environment variables of all commands.

    """

    def __init__(self, folder: Path, log: Path, variables: dict[str, str]) -> None:
        self._folder, self._log = folder, log
        self._site = folder / 'site'
        self._variables = {**variables, 'PYTHONPATH': f'{self._site}:{variables["PYTHONPATH"]}'}
        self._nodes: dict[str, CommandProcess] = {}
        self._names: dict[str, object] = {'setup': self._install}
        self._printed = ''
        for name in ('site', 'nodes', 'nodes/output'):
            (folder / name).mkdir()
        for place in (folder, folder / 'nodes'):
            (place / 'config').symlink_to(ROOT / 'config')
        languages = 'python', 'text', 'yaml', 'sh', 'console', 'diff'
        self.evaluators = {language: getattr(self, language) for language in languages}

    def python(self, example: Example) -> None:
        """Write a named module and import it, or execute a block."""
        if example.parsed.startswith('# masmc_ros/'):
            return
        named = FIRST_LINE.match(example.parsed)
        if named and re.search(r'^\s*\.\.\.$', example.parsed, re.MULTILINE):
            source = ROOT / 'examples' / named[1]
            self._check_excerpt(source, example.parsed)
            shutil.copy(source, self._site)
            importlib.invalidate_caches()
        elif named:
            (self._site / named[1]).write_text(example.parsed, encoding='utf-8')
            importlib.invalidate_caches()
            self._names |= vars(importlib.import_module(Path(named[1]).stem))
        elif inside := INSIDE.match(example.parsed):
            module = importlib.import_module(f'masmc_ros.{inside[1].replace("/", ".")}')
            exec(compile(example.parsed, example.path, 'exec'), {**vars(module)})
        else:
            with redirect_stdout(io.StringIO()) as output:
                exec(compile(example.parsed, example.path, 'exec'), self._names)
            self._printed = output.getvalue()

    def text(self, example: Example) -> None:
        """Compare with the output of the last Python block."""
        assert self._printed == example.parsed

    def yaml(self, example: Example) -> None:
        """Write or continue a named parameter file."""
        if named := FIRST_LINE.match(example.parsed):
            with (self._folder / named[1]).open('a', encoding='utf-8') as file:
                file.write(example.parsed)

    def sh(self, example: Example) -> None:
        """Run the commands of a block."""
        for words in commands(example.parsed):
            self._run(words)

    def console(self, example: Example) -> None:
        """Run commands and compare their output."""
        for words, expected in console(example.parsed):
            output = self._run(words)
            assert output is not None, shlex.join(words)
            if expected:
                pattern = re.escape(expected)
                for documented, actual in ANY_TEXT.items():
                    pattern = pattern.replace(re.escape(documented), actual)
                assert re.fullmatch(pattern, output), f'{output}\n!=\n{expected}'

    def diff(self, example: Example) -> None:
        """Check that a diff is about lines of the file named before it."""
        if example.parsed.startswith('--- masmc_ros/'):
            return
        before = example.document.text[: example.region.start]
        file = re.findall(r'`([\w/]+\.py)`', before)[-1]
        lines = [line[1:].strip() for line in example.parsed.splitlines() if line[0] in ' +']
        text = (ROOT / 'masmc_ros' / file).read_text(encoding='utf-8')
        assert all(line in text for line in lines), file

    def end_nodes(self, names: Sequence[str] | None = None) -> None:
        """Interrupt running nodes; each must end with status 0."""
        for name in self._nodes if names is None else names:
            if process := self._nodes.get(name):
                process.send_signal(signal.SIGINT)
                assert process.wait(PATIENCE) == 0, self._output(name)

    def kill_nodes(self) -> None:
        """Kill the nodes that still run."""
        for process in self._nodes.values():
            process.kill()

    def _install(self, *_: object, entry_points: dict[str, list[str]]) -> None:
        """Install entry points, as setuptools does, and load them."""
        lines = []
        for group, entries in entry_points.items():
            lines += [f'[{group}]', *entries]
            for entry in entries:
                name, value = map(str.strip, entry.split('='))
                assert EntryPoint(name, value, group).load() is not None
        folder = self._site / f'{name}-1.0.dist-info'
        folder.mkdir()
        (folder / 'METADATA').write_text(f'Name: {name}\nVersion: 1.0\n')
        (folder / 'entry_points.txt').write_text('\n'.join(lines) + '\n')

    @staticmethod
    def _check_excerpt(file: Path, excerpt: str) -> None:
        """Check that the parts between lines of dots are in a file, in their order."""
        text = file.read_text(encoding='utf-8')
        place = 0
        for part in re.split(r'^\s*\.\.\.\n', excerpt.partition('\n')[2], flags=re.MULTILINE):
            place = text.find(part.strip('\n'), place)
            assert place >= 0, f'not in {file}:\n{part}'

    def _run(self, words: Sequence[str]) -> str | None:
        """Run a command, if it is one of this package; return its output."""
        if COMPILED & set(words[1:2]):
            words = [PLANAR.get(word, word) for word in words]
        match list(words):
            case ['ros2', 'run', 'foxglove_bridge' | 'teleop_twist_keyboard', *_]:
                return None  # another package
            case ['masmc' | 'ros2', 'run', *arguments] if '--help' not in arguments:
                self._start([word for word in arguments if word != 'masmc_ros'])
                return ''
            case ['masmc', 'view' | 'play', *arguments]:
                return self._serve(words[1], arguments)
            case ['masmc', 'demo', *_]:
                return None  # test_environment.py executes it
            case ['masmc', *arguments] if '--scheduler' in arguments:
                return None  # test_cluster.py has one
            case ['masmc', *arguments] if any(word.startswith('topics:') for word in arguments):
                return None  # test_topic_controller.py has the node
            case ['masmc', 'laws', '--cost']:
                return None  # it compiles every law; test_compare.py executes it for few
            case ['masmc' | 'ros2', 'param', *arguments]:
                name = next((w[1:] for w in words if w in OTHER_NODES), 'controller')
                if not {name, 'composed'} & self._nodes.keys():  # the page assumes running nodes
                    self._start([name])
                arguments = ['param', *arguments, '--timeout', f'{COMPILING:g}']
                # A negative number after the options would be one.
                if len(words) > 4 and words[-1].startswith('-'):
                    arguments.remove(words[-1])
                    arguments += ['--', words[-1]]
                return self._masmc(arguments)
            case ['masmc', *arguments]:
                return self._masmc(*self._shortened(arguments))
        return None

    def _shortened(self, arguments: list[str]) -> tuple[list[str], bool]:
        """Return arguments that take less time, and if the command is not to be compiled."""
        command = arguments[0]
        is_shortened = command in ('compare', *CAMPAIGNS) or (
            command == 'simulate' and not WHOLE & set(arguments[1:2])
        )
        if is_shortened:
            arguments += ['--set', 'duration=0.05']
        for option, value in SMALLER.items():
            if option in arguments:
                arguments[arguments.index(option) + 1] = value
        if command == 'compare' and '--laws' not in arguments:
            arguments += ['--laws', 'smc,rasmc']
        if command == 'page':
            arguments += ['--laws', 'rasmc:tanh']  # the last one counts
        if command == 'warm':
            arguments += ['--laws', 'rasmc']
        is_single = command in ('simulate', 'compare')
        is_interpreted = is_shortened and (is_single or arguments[1] in TREES)
        return arguments, is_interpreted

    def _masmc(self, arguments: list[str], is_interpreted: bool = False) -> str:
        self._prepare(arguments)
        if '--controller' in arguments:
            place = arguments.index('--controller') + 1
            arguments[place] = str(self._site / arguments[place])
        # These start processes. Numba reads its variables when it is imported.
        starts = arguments[0] in ('compare', 'demo', 'laws', *CAMPAIGNS)
        is_fresh = starts or is_interpreted or any(self._site.iterdir())
        run = _run_fresh if is_fresh else run_command
        variables = {**self._variables, **(INTERPRETED if is_interpreted else {})}
        done = run(*arguments, folder=self._folder, environment=variables, patience=COMPILING)
        # `masmc param set` prints why a value is rejected.
        expected = 1 if done.stderr.startswith('Setting parameter failed') else 0
        assert done.returncode == expected, f'{shlex.join(arguments)}\n{done.stdout}{done.stderr}'
        return done.stdout + done.stderr

    def _prepare(self, arguments: Sequence[str], folder: str = '') -> None:
        """Create the files that a command reads and that the page has not written."""
        for before, word in pairwise(arguments):
            path = self._folder / folder / word
            is_read = before not in ('--output', '--write')
            if is_read and word.endswith(('.mcap', '.yaml')) and not path.exists():
                config = ROOT / 'config' / f'{SAMPLES.get(word, "paper")}.yaml'
                written = self._folder / word
                sample = self._log if word.endswith('.mcap') else config
                path.parent.mkdir(exist_ok=True)
                shutil.copy(written if written.exists() else sample, path)

    def _start(self, arguments: list[str]) -> None:
        """Start a node and wait until it responds."""
        name = arguments[0]
        self.end_nodes([name])
        self._prepare(arguments, 'nodes')
        if name in SERVED:  # the default port may be in use
            pytest.importorskip(SERVED[name])
            arguments = [*arguments, '--ros-args', '-p', 'port:=0']
        folder = self._folder / 'nodes'
        self._nodes[name] = CommandProcess(
            ['run', *arguments],
            self._variables,
            folder / 'output' / f'{name}.out',
            folder / 'output' / f'{name}.err',
            folder,
        )
        responding = 'controller' if name == 'composed' else name
        try:
            self._masmc(['param', 'list', f'/{responding}', '--timeout', f'{COMPILING:g}'])
        except AssertionError:
            raise AssertionError(self._output(name)) from None

    def _output(self, name: str) -> str:
        folder = self._folder / 'nodes' / 'output'
        return '\n'.join((folder / f'{name}.{end}').read_text() for end in ('out', 'err'))

    def _serve(self, command: str, arguments: list[str]) -> str:
        """Serve a log or a page until the instructions are printed."""
        self._prepare([command, *arguments])
        if command == 'play':
            pytest.importorskip(SERVED['play'])
            arguments = [*arguments, '--no-browser', '--port', '0']
        # Without viewers, on a desktop.
        variables = {**self._variables, 'PATH': '/usr/bin:/bin', 'DISPLAY': ':0'}
        with subprocess.Popen(
            [sys.executable, '-m', 'masmc_ros.cli.main', command, *arguments],
            cwd=self._folder,
            env=variables,
            stdout=subprocess.PIPE,
            text=True,
        ) as process:
            # The timer ends the reading of the output in any case.
            guard = threading.Timer(PATIENCE, process.kill)
            guard.start()
            try:
                assert process.stdout is not None
                lines = []
                for line in process.stdout:
                    lines.append(line)
                    if 'until Ctrl-C' in line:
                        process.send_signal(signal.SIGINT)
                assert process.wait() == 0
            finally:
                guard.cancel()
                process.kill()
        return ''.join(lines)


ANY_TEXT = {
    '...': r'[\s\S]*',
    '127.0.0.1:40311': r'127.0.0.1:\d+',
    '/home/you/masmc_ros': '.*',
    ': law = pid: compiling; rasmc continues until the code is ready': '.*',
    'Set parameter successful\n': r'Set parameter successful(: law = .*)?\n',
}
"""Documented text that differs between machines, and its pattern."""


def _run_fresh(
    *arguments: str, folder: Path, environment: dict[str, str], patience: float
) -> subprocess.CompletedProcess[str]:
    """Run `masmc ARGUMENTS` with packages installed by the page."""
    return subprocess.run(
        [sys.executable, '-m', 'masmc_ros.cli.main', *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=patience,
        stdin=subprocess.DEVNULL,
    )


@pytest.fixture(scope='module')
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a log of the paper's experiment."""
    folder = tmp_path_factory.mktemp('log')
    arguments = 'simulate', str(ROOT / 'config' / 'paper.yaml'), '--output', 'run.mcap'
    done = run_command(*arguments, folder=folder, environment=child_environment())
    assert done.returncode == 0, done.stderr
    return folder / 'run.mcap'


@pytest.fixture
def page_run(tmp_path: Path, log: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[PageRun]:
    with domain() as number:
        variables = {**child_environment(), **domain_variables(number)}
        run = PageRun(tmp_path, log, variables)
        monkeypatch.syspath_prepend(str(tmp_path / 'site'))
        imported = set(sys.modules)
        try:
            yield run
        finally:
            run.kill_nodes()
            for name in set(sys.modules) - imported:
                if (tmp_path / 'site' / f'{name}.py').exists():
                    del sys.modules[name]


@pytest.mark.parametrize('page', PAGES, ids=page_name)
def test_blocks_of_page_run(page: Path, page_run: PageRun) -> None:
    text = page.read_text(encoding='utf-8')
    if re.search(r'example-robot-data|config/(tiago|franka)', text):
        pytest.importorskip('pinocchio')  # it is installed with the robots
    if 'physics=mujoco' in text:
        pytest.importorskip('mujoco')
    for example in document(page, page_run.evaluators).examples():
        example.evaluate()
    page_run.end_nodes()
