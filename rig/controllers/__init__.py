"""One file per pressure controller, each behind straw.rig.controller.Controller."""
