"""All settings of the search and of what is compared, each with its reason."""

from __future__ import annotations

# -- simulation ------------------------------------------------------------------------------------------------------

#: Accuracy of a step, m, while searching. The derivatives are of what the integrator does and have no noise of their
#: own, so the search needs no more than the camera sees: its noise is 10 um, and a tenth of it is left over a run.
TOLERANCE_M = 5e-7
#: Water that swings carries what a step leaves out on to the next snap.
FINER_M = {"trapped_gas": 1e-7, "fluid_inertia": 1e-7}
#: Output step, s: a sixth of the period of the fastest ringing that the camera resolves at 240 Hz.
SIMULATED_EVERY_S = 2e-3
#: Steps a second a simulation may take, 1.6 times what the livelier run of the paper takes, and how that grows with
#: accuracy for a method of fourth order. A straw that nothing damps takes as long as many runs.
LIVELIEST_PER_S, STEPS_GROW = 1850.0 * (2e-7 / 5e-7) ** 0.25, 1 / 4
#: Where the recording shows more snaps than the prediction, it gets this much longer to snap, s: the latest snaps by a
#: cause of ten times the plausible size come 1.2 s late.
EXTRA_TIME_S = 1.5
#: Half-width in u of the secant through a straw's constants, which are smooth: its error is SECANT^2 / 6.
SECANT = 1e-3
#: Accuracy while only the slow part and the envelope are compared, m: a tenth of what these count as one sigma.
COARSE_TOLERANCE_M = 1e-6

# -- registration and noise ------------------------------------------------------------------------------------------

#: Time is bent as for the nearest snap from this long before the first to this long after the last, s, and back within
#: the next: a tip rings for half a second after a snap, and creeps for a tenth before it.
LANDMARK_BEFORE_S, LANDMARK_AFTER_S, REGISTRATION_FADES_S = 0.1, 0.6, 0.3
#: Noise of a track: share of its variance that lasts, and for how long, s (measured on another apparatus).
LASTING, LASTS_S = 0.38, 0.05
#: How far off a snap may be in a coarse fit, s: three frames of the camera at 240 Hz, less what a fine fit tells.
ROUGH_TIMING_S = 3e-3
#: A beginning or an end that only one of the two shows counts as this many sigmas, the edge of what noise may be:
#: whether a ring just reaches a level says little, and a snap that did not happen shows in all that follows.
MISSING_EVENT_SIGMAS = 3.0
#: A run that cannot be simulated counts as this many sigmas everywhere: farther than any that can.
FAILED_SIGMAS = 300.0

# -- search ----------------------------------------------------------------------------------------------------------

#: Evaluations of a first and of a last fit: Gauss-Newton on exact derivatives converges in 4 to 8 where it does.
FIRST_ROUNDS, ROUNDS = 5, 20
#: Evaluations in each round of the coarse tournament, and what share of the library goes on after each but the last.
COARSE_ROUNDS, HALVINGS = (3, 6, 15), (0.5, 0.25)
#: Starts of a hypothesis that are followed; hypotheses fitted from where first order puts them; second causes tried.
STARTS, SCREENED, PAIRS = 2, 8, 4
#: Squared sigmas beyond noise from which on a fit is far off: first order around it tells nothing.
FAR = 3000.0
#: Hypotheses carried to their end at a time, and fitted from each other's constants.
FINISHED, RIVALS = 4, 3
#: Longest step of a linear prediction in u, a unit of which is a factor e in what is searched by its logarithm.
LONGEST_STEP = 3.0
#: Squared sigmas beyond noise below which a fit explains the runs, and what a run may leave that is not worth a look.
NOTHING_LEFT, FAR_OFF = 300.0, 300.0
#: Hypotheses within this of the best (squared sigmas) are carried to their end: what a fit may still gain there.
CLOSE = 300.0
#: Strength in units of a law's scale at which laws are looked at to first order: next to nothing, and not nothing, as
#: gas of no volume has no spring and a line without delay no state.
FAINT = 0.01
#: Causes that are tried first of those a proposal puts in order, and pairs: it had the truth among the first eight in
#: nine of ten held-out simulations (`python -m tests.benchmarks.proposal`).
PROPOSED, PROPOSED_PAIRS = 8, 4
#: A derivative's cost in plain simulations (`python -m tests.benchmarks.derivatives`: 16 cost 4 to 5), and the work, in
#: steps of plain simulations, after which a straw's search ends where it is and settles nothing. Two idle cores did
#: 40,000 to 59,000 a second on the four campaigns of `../shared/recordings`: 130 to 190 s, where 180 are asked.
COLUMN_COSTS, MOST_WORK = 0.25, 7.5e6
#: Stages that progress is told in, at most.
STAGES = 7
