"""What a process of the audit's own does in a test: it takes long, and says when it has begun and ended."""

from __future__ import annotations

import time
from typing import Any

from conformance.audit.session import AuditSettings


def nap(_entry_id: str, settings: AuditSettings) -> Any:
    """Stand for an entry that takes half a minute."""
    assert settings.folder
    (settings.folder / "begun").touch()
    time.sleep(30.0)
    (settings.folder / "ended").touch()
