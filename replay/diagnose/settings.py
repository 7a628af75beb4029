"""All settings of the engine, each with its reason: of what is compared, of the search, of what is told.

`python -m tests.benchmarks.settings` says what the answers do when one is halved or doubled. What decides between two
causes is calibrated, not set: `calibration.toml`.
"""

from __future__ import annotations

# -- simulation ------------------------------------------------------------------------------------------------------

#: Accuracy of a step, m, while searching. The derivatives are of what the integrator does and have no noise of their
#: own, so the search needs no more than the camera sees: its noise is 10 um, and a tenth of it is left over a run.
TOLERANCE_M = 5e-7
#: Water that swings carries what a step leaves out on to the next snap.
FINER_M = {"trapped_gas": 1e-7, "fluid_inertia": 1e-7}
#: Output step, s: a sixth of the period of the fastest ringing that the camera resolves at 240 Hz.
SIMULATED_EVERY_S = 2e-3
#: Steps a second a simulation may take to `TOLERANCE_M`, 1.6 times what the livelier run of the paper takes. A straw
#: that nothing damps takes as long as many runs.
LIVELIEST_PER_S = 1470.0
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

#: Differences beyond this many sigmas count with their size, not their square.
ROBUST_SIGMAS = 5.0

# -- search ----------------------------------------------------------------------------------------------------------

#: Evaluations of a first and of a last fit: Gauss-Newton on exact derivatives converges in 4 to 8 where it does.
FIRST_ROUNDS, ROUNDS = 5, 20
#: Evaluations in each round of the coarse tournament, and what share of the library goes on after each but the last.
COARSE_ROUNDS, HALVINGS = (3, 6, 15), (0.5, 0.25)
#: Starts of a hypothesis that are followed down in the coarse tournament.
STARTS = 2
#: Hypotheses that are tried before the others: of those that first order promises most, and of those that the proposal
#: puts in order, which had the truth among the first eight in nine of ten held-out simulations
#: (`python -m tests.benchmarks.proposing`).
SHORTLIST = 8
#: What is followed of any list of the most promising: second causes, proposed pairs, hypotheses carried to their end,
#: rivals fitted from each other's constants, starts of the base. Fewer miss the truth, more cost a fit each.
FOLLOWED = 4
#: Squared sigmas beyond noise from which on a fit is far off: first order around it tells nothing.
FAR = 3000.0
#: What noise and forks of repeats leave unexplained even with the right model, sigmas squared: below it a fit explains
#: the runs, a run is not worth a look, and a hypothesis so near to the best may still win.
NOISE_LEAVES = 300.0
#: Longest step of a linear prediction in u, a unit of which is a factor e in what is searched by its logarithm.
LONGEST_STEP = 3.0
#: Strength in units of a law's scale at which laws are looked at to first order: next to nothing, and not nothing, as
#: gas of no volume has no spring and a line without delay no state.
FAINT = 0.01
#: Points drawn from the priors of a base and from the posterior of a coarse fit (a Sobol set covers them evenly with a
#: power of two), and by how much the latter is widened: 3 and 10 reached the best minimum in three of three
#: cases in which the base's fit had been stuck, 1 in two.
DRAWN, WIDENED = 64, 10.0
#: Step of a numerical derivative in u, a unit of which is well seen or a factor e: the cube root of a simulation's
#: accuracy of some 1e-10, where truncation and rounding of a central difference are alike (Press et al., Numerical
#: Recipes, section 5.7).
STEP_U = 4e-4
#: A derivative's cost in plain simulations (`python -m tests.benchmarks.derivatives`: 16 cost 4 to 5), and the work, in
#: steps of plain simulations, after which a straw's search ends with what it has found. Two idle cores did
#: 40,000 to 59,000 a second on the four campaigns of `../shared/recordings`: 130 to 190 s, where 180 are asked.
COLUMN_COSTS, MOST_WORK = 0.25, 7.5e6

# -- what is told ----------------------------------------------------------------------------------------------------

#: Samples that are looked at together for differences beyond noise, and how many deviations of their sum of squares
#: are beyond it: one in three million by chance.
BLOCK, BEYOND = 24, 5.0
#: Constants of a hypothesis that count against it: those that have more are tables with priors of their own.
MOST_COUNTED = 4
#: Hypotheses survive that are together as probable as this, of what the search can be sure of.
COVERED = 0.95
#: A hypothesis this probable is named alone; less, and the set that survives is named.
NAMED_ALONE = 0.8
#: A second cause is accepted when fewer simulated campaigns with the first alone than this give one by chance: a false
#: pair may be named in one of fifty.
BY_CHANCE = 0.02
#: Squared sigmas that are one deviation of a constant: six instruments' constants were 0.04 to 2.2 of these off.
ONE_DEVIATION = 20.0
#: An RMS is worse when it is larger by this factor: noise that lasts 50 ms leaves some 60 independent samples in a run
#: of a few seconds, so an RMS has a standard deviation of 1 / sqrt(120) = 9 %, and this is three of them.
WORSE = 1.27
