"""Finds and runs the command skysweep. Nothing here needs QGIS, so that it can be tested without.

Progress comes as JSON lines on standard error (`--progress json`), the report as JSON on standard
output (`--json`).
"""

import json
import os
import shutil
import signal
import subprocess
import threading
import time

# Seconds that a cancelled command has to end before it is killed.
GRACE_S = 5.0
# Seconds between two looks at whether the user cancelled.
POLL_S = 0.1


class CommandError(Exception):
    """The command is missing, failed or was cancelled. The text is meant for the user."""


class Cancelled(CommandError):
    """The user cancelled."""


class Finished:
    """What a command left: its report, and whether it missed a requested threshold."""

    def __init__(self, report, missed):
        self.report = report
        self.missed = missed


def find_command(configured=""):
    """Returns the path of the command: the configured one, or SKYSWEEP_COMMAND, or the one in PATH."""
    named = {"the option of the provider": configured, "SKYSWEEP_COMMAND": os.environ.get("SKYSWEEP_COMMAND", "")}
    for source, path in named.items():
        if path:
            found = shutil.which(os.path.expanduser(path))
            if not found:
                raise CommandError(f"{source} names {path}, which is no program that can be run")
            return found
    found = shutil.which("skysweep")
    if not found:
        raise CommandError(
            "the command skysweep was not found: install it, or name its file under Settings, Options, Processing, "
            "Providers, skysweep"
        )
    return found


def arguments_of(algorithm, values):
    """Returns the arguments of an algorithm of the catalogue.

    `values` holds for each parameter that is set a string, a list of strings, or True. Options come
    first and the positional arguments last, after `--`, so that no file name passes for an option.
    """
    options, positional = [], []
    for parameter in algorithm["parameters"]:
        value = values.get(parameter["name"])
        if value is None or value is False or value == []:
            continue
        if parameter.get("argument"):
            positional += value if isinstance(value, list) else [value]
        elif value is True:
            options.append(parameter["option"])
        elif parameter.get("joined"):
            options.append(f"{parameter['option']}={','.join(value)}")
        elif isinstance(value, list):
            options += [parameter["option"], *value]
        else:
            # In one word, so that a negative number is no option.
            options.append(f"{parameter['option']}={value}")
    return [*algorithm["command"], "--progress", "json", "--json", *options, "--", *positional]


class Stages:
    """Turns events into a percentage. Stages follow each other; each is shown from 0 to 100 %."""

    def __init__(self):
        self.steps = 0

    def percent(self, event):
        """Returns the percentage after an event, or None where it says nothing of it."""
        if event.get("event") == "stage":
            self.steps = event.get("steps", 0)
            return 0.0
        if event.get("event") == "step" and self.steps:
            return min(100.0, 100.0 * event.get("done", 0) / self.steps)
        return None


def run(command, arguments, on_event=lambda event: None, on_text=lambda text: None, is_cancelled=lambda: False):
    """Runs the command and returns `Finished`.

    `on_event` gets each event of the progress, `on_text` each other line of standard error. Both are
    called from the calling thread. Raises `Cancelled`, and `CommandError` with the command's own text.
    """
    on_windows = os.name == "nt"
    flags = {"creationflags": subprocess.CREATE_NO_WINDOW} if on_windows else {"start_new_session": True}
    try:
        process = subprocess.Popen(
            [command, *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            errors="replace",
            **flags,
        )
    except OSError as error:
        raise CommandError(f"{command} cannot be started: {error}") from error
    printed, lines, lock = [], [], threading.Lock()

    def read_lines():
        for line in process.stderr:
            with lock:
                lines.append(line.rstrip("\n"))

    readers = [
        threading.Thread(target=lambda: printed.append(process.stdout.read()), daemon=True),
        threading.Thread(target=read_lines, daemon=True),
    ]
    for reader in readers:
        reader.start()
    told = _Told(on_event, on_text)

    def tell():
        with lock:
            new, lines[:] = list(lines), []
        for line in new:
            told.line(line)

    def close():
        for reader in readers:
            reader.join()
        process.stdout.close()
        process.stderr.close()

    while process.poll() is None:
        tell()
        if is_cancelled():
            _stop(process)
            close()
            raise Cancelled("cancelled: nothing was written under a final name")
        time.sleep(POLL_S)
    close()
    tell()
    if process.returncode not in (0, 1):
        raise CommandError(told.reason(process.returncode))
    try:
        report = json.loads(printed[0])
    except (ValueError, IndexError):
        # A command that failed in parts may have no report.
        if process.returncode != 0:
            raise CommandError(told.reason(process.returncode)) from None
        report = None
    return Finished(report, process.returncode == 1)


class _Told:
    """Hands lines on, and keeps what explains a failure."""

    def __init__(self, on_event, on_text):
        self.on_event, self.on_text = on_event, on_text
        self.error, self.texts = None, []

    def line(self, line):
        event = None
        if line.startswith("{"):
            try:
                event = json.loads(line)
            except ValueError:
                event = None
        if not isinstance(event, dict) or "event" not in event:
            self.texts.append(line)
            self.on_text(line)
            return
        if event["event"] == "error":
            self.error = ": ".join([event.get("text", ""), *event.get("causes", [])])
        self.on_event(event)

    def reason(self, code):
        """Returns why the command failed, in its own words where it used any."""
        if self.texts:
            return "\n".join(self.texts)
        return self.error or f"skysweep ended with code {code} and said nothing"


def _stop(process):
    """Ends the command: politely, then by force."""
    if os.name == "nt":
        process.terminate()
    else:
        os.killpg(process.pid, signal.SIGTERM)
    try:
        process.wait(GRACE_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
