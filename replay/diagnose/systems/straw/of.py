"""The straw of a campaign of straws, and the campaign with another."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

from straw.model.parameters import StrawParameters
from straw.replay.diagnose.campaign import Campaign


def straw_of(campaign: Campaign) -> StrawParameters:
    """The straw that a campaign starts from."""
    straw = cast(Any, campaign.system).straw
    assert isinstance(straw, StrawParameters)
    return straw


def with_straw(campaign: Campaign, straw: StrawParameters) -> Campaign:
    """The campaign with another straw to start from."""
    return campaign.with_system(replace(cast(Any, campaign.system), straw=straw))
