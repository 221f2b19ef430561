"""What every command with a journal promises of what it resumes: `sweep`, `study` and `tune`."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path


def finished(journal: Path) -> tuple[str, list[str]]:
    """A journal's line of settings, and those of finished parts."""
    settings, *lines = journal.read_text().splitlines(keepends=True)
    return settings, [line for line in lines if line.startswith('{"finished":')]


def resume(
    run: Callable[[], subprocess.CompletedProcess[str]], whole: Path, out: Path, count: int, files: list[str]
) -> subprocess.CompletedProcess[str]:
    """Resumes after the first finished parts of what ran whole in another folder, and an end within a line.

    Files are the same, byte for byte, and no finished part runs again; nor does any of what is finished.
    """
    settings, parts = finished(whole / "journal.jsonl")
    journal = out / "journal.jsonl"
    before = "".join([settings, *parts[:count]])
    journal.write_text(before + parts[count][:20])
    done = run()
    for file in files:
        assert (out / file).read_bytes() == (whole / file).read_bytes(), file
    after = journal.read_text()
    assert after.startswith(before)
    assert sorted(finished(journal)[1]) == sorted(parts)
    run()
    assert journal.read_text() == after
    return done
