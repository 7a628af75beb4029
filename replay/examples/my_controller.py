"""A driver in a file: here an OB1 MK4 that notes how often it was asked. `straw check my_controller.py` checks it.

A driver of another instrument is a class made of straw.Controller, with the methods that have an underscore; limits,
plausibility of readings and venting are the base class's. An ``EMULATOR`` beside it answers for it without hardware.
"""

from straw.rig.controllers import ob1_mk4
from straw.rig.emulators.ob1_mk4 import EMULATOR as EMULATOR  # it speaks the same
from straw.rig.reading import Answer


class MyController(ob1_mk4.CONTROLLER):
    """An OB1 MK4 that counts its readings."""

    name = "my-controller"
    asked = 0

    def _read(self) -> Answer:
        self.asked += 1
        return super()._read()

    def snapshot(self) -> dict[str, str]:
        """What a recording says about the instrument."""
        return {**super().snapshot(), "asked": str(self.asked)}


CONTROLLER = MyController
