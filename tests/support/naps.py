"""What a process of the audit's own does in a test: it takes long, and says when it has begun and ended."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

from conformance.audit import ledger, session
from conformance.audit.session import AuditSettings


def nap(_entry_id: str, settings: AuditSettings) -> Any:
    """Stand for an entry that takes half a minute."""
    assert settings.folder
    (settings.folder / "begun").touch()
    time.sleep(30.0)
    (settings.folder / "ended").touch()


if __name__ == "__main__":
    from support import naps

    session._examine_apart = naps.nap
    with session._elsewhere(AuditSettings(folder=Path(sys.argv[1]), apart=True), list(ledger.select("M10"))):
        time.sleep(60.0)
