"""`planarm flash`: a real avrdude, a real boot loader, the released image, and the board asked who it is."""

import json
import os
import shutil

import pytest

from planarm.cli.main import main
from planarm.link.released_image import released_image
from planarm_sim import Uno
from planarm_sim.loader import load_hex
from sim_board.optiboot import build_optiboot
from sim_board.test_sim_bootloader import board_behind_a_terminal


@pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals need a POSIX system")
def test_the_released_image_is_written_verified_and_asked(tmp_path, capsys):
    if shutil.which("avrdude") is None:
        pytest.skip("avrdude is not installed; it does the upload")
    uno = Uno.from_bootloader(build_optiboot(tmp_path), usb="16u2")
    with board_behind_a_terminal(uno) as (path, _, _), pytest.raises(SystemExit) as left:
        main(["flash", "--port", path, "--json"])
    told = json.loads(capsys.readouterr().out)
    assert left.value.code == 0, told
    assert told["verified"] is True
    assert (told["state"], told["position_usteps"]) == ("idle", [0, 0])
    image = load_hex(released_image())
    assert uno.flash[: image.used_bytes] == image.flash[: image.used_bytes]
