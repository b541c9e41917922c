"""`file://PATH`: what a host sends goes into a file, as it would go to a board; an emulated board answers."""

from pathlib import Path

from planarm.errors import LinkError
from planarm.link.arm_record import ArmSetup, emulated_board
from planarm.link.released_image import released_image
from planarm.link.sim_transport import SimTransport
from planarm_wire.boards import Board
from planarm_wire.messages import BAUD


class FileTransport(SimTransport):
    """An emulated board, and a file with every byte that is sent to it; `planarm dump` reads it."""

    def __init__(
        self, path: str | Path, baud: int = BAUD, setup: ArmSetup | None = None, board: Board | None = None
    ) -> None:
        board = board or emulated_board(setup)
        super().__init__(released_image(board.name), baud, setup, board=board)
        self._path = Path(path)
        try:
            self._file = self._path.open("wb")
        except OSError as error:
            raise LinkError(f"port file://{path}: cannot be written: {error.strerror}; give another path") from error

    def write(self, data: bytes) -> None:
        """Write `data` into the file, and to the board."""
        super().write(data)
        try:
            self._file.write(data)
        except OSError as error:
            raise LinkError(f"port file://{self._path}: cannot be written: {error.strerror}") from error

    def close(self) -> None:
        """Close the file and stop using the board."""
        super().close()
        self._file.close()
