"""Places that cannot be written are refused with the cause, before any work is done for them."""

import os
import re

import pytest

from planarm.errors import OutputError
from planarm.output import require_folder_place, require_place, writing


@pytest.fixture
def forbidden(tmp_path, monkeypatch):
    """A folder that may not be written into; the tests may run as root, who may, so the system's answer is made up."""
    folder = tmp_path / "shut"
    folder.mkdir()
    monkeypatch.setattr(os, "access", lambda path, mode: not (mode & os.W_OK and path == folder))
    return folder


def test_a_folder_that_may_not_be_written_into(forbidden):
    words = f"cannot be written: {re.escape(str(forbidden))} may not be written into; give another place"
    with pytest.raises(OutputError, match=words):
        require_folder_place(forbidden / "run")
    with pytest.raises(OutputError, match=f"cannot be written: {re.escape(str(forbidden))} may not be written; give"):
        require_place(forbidden / "a.plan")
    require_place(forbidden.parent / "a.plan")


def test_a_file_in_the_place_of_a_folder(tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    for place in (file, file / "deeper"):
        with pytest.raises(OutputError, match="file is a file; give the path of a folder"), writing(place):
            place.mkdir(parents=True, exist_ok=True)
