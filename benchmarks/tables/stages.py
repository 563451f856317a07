"""Runs a command once: what it took, and why it failed, stay in a file beside its results."""

from __future__ import annotations

import os
import platform
import signal
import subprocess
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from si3fp.errors import InputError
from si3fp.workspace import dump_json, read_json, write_text

LAST_CHARACTERS = 600
POLL_S = 0.2
ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Stage:
    """What became of a command.

    Attributes
    ----------
    done
        Whether its results are there.
    command, key
        Its arguments, and what names its inputs.
    reason
        Why it failed: the end of what it said; empty where it did not.
    seconds, peak_mib
        Wall clock, and the largest of its processes at its peak.
    machine
        Where it ran.
    """

    done: bool
    command: tuple[str, ...]
    key: str = ""
    reason: str = ""
    seconds: float = 0.0
    peak_mib: float = 0.0
    machine: str = ""


def run_stage(
    record: Path,
    command: Sequence[str],
    *,
    allowed: Sequence[int] = (0,),
    limit_s: float = 3 * 3600.0,
    key: str = "",
    extra: Sequence[str] = (),
) -> Stage:
    """The command's outcome; it is not run again where its record says that it is done.

    Parameters
    ----------
    record
        JSON file of the outcome; what the command says goes to a ``.log`` beside it.
    command
        Program and arguments.
    allowed
        Exit codes that mean done.
    limit_s
        The command is ended after so many seconds, with all that it started.
    key
        Names its inputs: the command runs again where they are others than before.
    extra
        Arguments that are no part of what is recorded; with any, the command always runs.
    """
    before = read_stage(record)
    same = before is not None and (before.command, before.key) == (tuple(command), key)
    if before is not None and before.done and same and not extra:
        return before
    record.parent.mkdir(parents=True, exist_ok=True)
    record.unlink(missing_ok=True)  # what is cut off now was never done
    log = record.with_suffix(".log")
    start = time.monotonic()
    with log.open("wb") as stream:
        code, peak_mib = _run([*command, *extra], stream.fileno(), limit_s)
    seconds = time.monotonic() - start
    reason = "" if code in allowed else _reason(code, log, limit_s)
    stage = Stage(
        not reason, tuple(command), key, reason, round(seconds, 1), round(peak_mib, 1), machine()
    )
    write_text(record, dump_json(asdict(stage)))
    return stage


def read_stage(record: Path) -> Stage | None:
    """The outcome in a record, or None where there is none that can be read."""
    try:
        content = read_json(record)
        return Stage(**{**content, "command": tuple(content["command"])})
    except (InputError, TypeError, KeyError):
        return None


def machine() -> str:
    """Processor, cores and memory of this machine, as text."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = info.read_text(encoding="utf-8").splitlines()
        names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
        name = names[0] if names else name
    memory_gib = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    return f"{os.cpu_count()} cores of {name}, {memory_gib:.0f} GiB"


def _run(command: Sequence[str], output: int, limit_s: float) -> tuple[int | None, float]:
    """Exit code (None where the time ran out) and the largest process of the tree in MiB."""
    process = subprocess.Popen(
        command, stdout=output, stderr=subprocess.STDOUT, start_new_session=True, cwd=ROOT
    )
    end = time.monotonic() + limit_s
    late = False
    try:
        while True:
            # Unlike `Popen.wait`, this tells what the process and its children used.
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                break
            if time.monotonic() > end and not late:
                late = True
                os.killpg(process.pid, signal.SIGKILL)
            time.sleep(POLL_S)
    except BaseException:
        os.killpg(process.pid, signal.SIGKILL)
        raise
    process.returncode = os.waitstatus_to_exitcode(status)
    return None if late else process.returncode, usage.ru_maxrss / 1024


def _reason(code: int | None, log: Path, limit_s: float) -> str:
    said = log.read_text(encoding="utf-8", errors="replace").strip()[-LAST_CHARACTERS:]
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    last = lines[-1] if lines else "it said nothing"
    if code is None:
        return f"stopped after {limit_s / 60:.0f} minutes; last: {last}"
    return f"exit code {code}: {last}"
