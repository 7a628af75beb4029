"""Which candidates are fitted: the most promising to first order, and those like the best that was found."""

from __future__ import annotations

from collections.abc import Sequence

from straw.replay.diagnose.discover.choose import OF_NEARLY
from straw.replay.diagnose.discover.screen import Candidate
from straw.replay.diagnose.systems.function.laws import Law

#: Candidates fitted, of each place and over each state at most.
FITTED, ALIKE = 9, 3


def picked(promised: Sequence[Candidate]) -> list[Candidate]:
    """The most promising, of different places and over different states.

    A law over the history of a state is fitted from its best lag, and beside it the law over the state itself; a lag of
    a reading or an input from each, as that decides where a fit ends.
    """
    places: dict[str, int] = {}
    states: dict[str, int] = {}
    out: list[list[Candidate]] = []
    known: set[tuple[str, str]] = set()
    for one in promised:
        place, state = one.law.place.name, one.law.over if one.law.own else one.law.state.name
        if one.leaves > 0.98 or (place, state) in known or len(out) == FITTED:
            continue
        if places.get(place, 0) >= ALIKE or states.get(state, 0) >= ALIKE:
            continue
        known.add((place, state))
        places[place], states[state] = places.get(place, 0) + 1, states.get(state, 0) + 1
        own = [x for x in promised if x.law.place.name == place and x.law.state.name == one.law.state.name]
        prompt = [x for x in own if x.law.state.lag_s is None and one.law.state.lag_s is not None]
        late = [x for x in own if x.law.own and x is not one]
        out.append([one, *(late if one.law.own else prompt)])
    return [one for group in out for one in group]


def elsewhere(best: Law, promised: Sequence[Candidate], known: Sequence[Candidate]) -> list[Candidate]:
    """Candidates like the best law that were not tried: over its state at other places, and at its place over states
    that promise nearly as much. To first order about a base that is far off, its own may not promise most."""
    tried = {(one.law.place.name, one.law.over) for one in known}
    own = min(one.leaves for one in promised if one.law.place.name == best.place.name and one.law.over == best.over)
    out: dict[tuple[object, ...], Candidate] = {}
    for one in promised:
        there = one.law.place.name == best.place.name and OF_NEARLY * one.leaves <= own
        if one.law.over == best.over or (there and not one.law.state.remembers):
            late = (one.law.state.lag_s, one.law.state.play) if one.law.own else None
            out.setdefault((one.law.place.name, one.law.over, late), one)
    return [one for (place, over, _), one in out.items() if (place, over) not in tried]
