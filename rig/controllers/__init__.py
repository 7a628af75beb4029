"""One file per pressure controller, each behind rig.controller.Controller."""
