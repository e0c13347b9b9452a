# Copyright 2026 The masmc_ros authors
# SPDX-License-Identifier: Apache-2.0

"""Button of the page for the report of the run so far."""

from __future__ import annotations

from pathlib import Path
import subprocess
from tempfile import TemporaryDirectory

from masmc_ros.child_process import module_command
from masmc_ros.nodes.play.controls import Controls
from masmc_ros.nodes.play.page import PlayServer, text_block
from viser import GuiButtonHandle, GuiEvent

_PAGE = 'report.html'

_LABEL = 'Report this run'

_WRITER = 'masmc_ros.nodes.play.run_report'
"""Module of the process that writes the report."""


class ReportButton:
    """
    Button for the report of the run so far, which viewers get as a file.

    viser calls the function of the button on a separate thread; `update` does the work.
    """

    def __init__(self, server: PlayServer, recording: Path, recorded_time: float) -> None:
        """
        Add the button.

        Parameters
        ----------
        server
            Server of the page.
        recording
            File of the recorder, or folder of its parts.
        recorded_time
            Robot time in s that the recording keeps; 0: the whole run.

        """
        self._server, self._recording = server, recording
        self._folder = TemporaryDirectory(prefix='masmc_report_')
        self._process: subprocess.Popen[str] | None = None
        self._viewers: set[int] = set()
        hint = 'Report of what has been recorded so far, as a page that needs no other file'
        self._button = server.gui.add_button(_LABEL, hint=hint, order=5.0)
        self._button.on_click(self._on_click)
        kept = f'the last {recorded_time / 60.0:g} minutes' if recorded_time else 'the whole run'
        server.gui.add_html(text_block([f'The recording keeps {kept}.']), order=5.5)

    def _on_click(self, event: GuiEvent[GuiButtonHandle]) -> None:
        if event.client_id is not None and self._server.is_own_page(event.client_id):
            self._viewers.add(event.client_id)

    def update(self, controls: Controls) -> None:
        """Start a report that a viewer requests; send one that is ready, or show its error."""
        if self._process is None:
            if self._viewers:
                self._start()
            return
        if self._process.poll() is None:
            return
        process, self._process = self._process, None
        self._button.label, self._button.disabled = _LABEL, False
        _, errors = process.communicate()
        viewers, self._viewers = self._viewers, set()
        if process.returncode:
            controls.show_error(_LABEL, (errors.strip().splitlines() or ['it ended'])[-1])
            return
        controls.clear_error(_LABEL)
        content = self._page.read_bytes()
        for number, viewer in self._server.get_clients().items():
            if number in viewers:
                viewer.send_file_download(_PAGE, content)

    @property
    def _page(self) -> Path:
        return Path(self._folder.name) / _PAGE

    def _start(self) -> None:
        self._button.label, self._button.disabled = 'Report is being written', True
        self._process = subprocess.Popen(
            module_command(_WRITER, str(self._recording), str(self._page)),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )

    def close(self) -> None:
        """End the process, and remove the page."""
        if self._process is not None:
            self._process.terminate()
            self._process.communicate()
        self._folder.cleanup()
