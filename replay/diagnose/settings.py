"""All settings of the engine, each with its reason: comparison, search, and reporting.

`python -m tests.benchmarks.settings` shows how the answers change when one is halved or doubled. The constants that
decide between causes are calibrated, not set: `calibration.toml`.
"""

from __future__ import annotations

# -- simulation ------------------------------------------------------------------------------------------------------

#: Tolerance of a step, m, while searching. The derivatives are exact for the integrator and have no noise of their own,
#: so the search needs the camera's accuracy only: its noise is 10 um, and the error over a run a tenth of it.
TOLERANCE_M = 5e-7
#: Swinging water carries the error of a step on to the next snap.
FINER_M = {"trapped_gas": 1e-7, "fluid_inertia": 1e-7}
#: Output step, s: a sixth of the period of the fastest ringing that the camera resolves at 240 Hz.
SIMULATED_EVERY_S = 2e-3
#: Steps a second a simulation may take at `TOLERANCE_M`, 1.6 times those of the faster run of the paper. An undamped
#: straw would take as long as many runs.
LIVELIEST_PER_S = 1470.0
#: Extra time of a prediction with fewer snaps than the recording, s: a cause of ten times the plausible size delays
#: snaps by up to 1.2 s.
EXTRA_TIME_S = 1.5
#: Half-width in u of the secant through a straw's constants, which are smooth: its error is SECANT^2 / 6.
SECANT = 1e-3
#: Tolerance while only the slow part and the envelope are compared, m: a tenth of their sigma.
COARSE_TOLERANCE_M = 1e-6

# -- registration and noise ------------------------------------------------------------------------------------------

#: Time is shifted as for the nearest snap from this long before the first to this long after the last, s, and shifted
#: back within the next: a tip rings for half a second after a snap, and creeps for a tenth before it.
LANDMARK_BEFORE_S, LANDMARK_AFTER_S, REGISTRATION_FADES_S = 0.1, 0.6, 0.3
#: Noise of a track: correlated share of its variance, and its correlation time, s (measured on another apparatus).
LASTING, LASTS_S = 0.38, 0.05
#: Tolerance of a snap's time in a coarse fit, s: three frames of the camera at 240 Hz.
ROUGH_TIMING_S = 3e-3
#: A beginning or an end of a snap in only one of the two counts as this many sigmas, the limit of noise: whether a ring
#: just reaches a level is hardly informative, and a missing snap shows in all samples that follow.
MISSING_EVENT_SIGMAS = 3.0
#: A run that cannot be simulated counts as this many sigmas everywhere: farther than any that can.
FAILED_SIGMAS = 300.0

#: Differences beyond this many sigmas count linearly, not squared.
ROBUST_SIGMAS = 5.0

# -- search ----------------------------------------------------------------------------------------------------------

#: Evaluations of a first and of a last fit: Gauss-Newton on exact derivatives converges in 4 to 8 where it does.
FIRST_ROUNDS, ROUNDS = 5, 20
#: Evaluations in each round of the coarse tournament, after each of which the better half is kept.
COARSE_ROUNDS = (3, 6, 15)
#: Reduced chi-square below which a fit explains the coarse comparison. Its sigmas leave room for envelopes that differ:
#: on developing pairs and on `../shared/recordings` right hypotheses left 0.13 to 0.21 (16 fits), wrong ones, laws of
#: another form and wrong minima 0.31 and more.
EXPLAINED = 0.3
#: Starts of a hypothesis that are followed in the coarse tournament.
STARTS = 2
#: Hypotheses tried before the others: the most promising to first order, and the first of the proposal's order, which
#: had the truth among the first eight in nine of ten held-out simulations
#: (`python -m tests.benchmarks.proposing`).
SHORTLIST = 8
#: Entries followed of any list of the most promising: single causes, pairs, second causes, finished hypotheses, rivals
#: fitted from each other's constants, starts of the base, step lengths of a second cause, runs left out. Fewer may miss
#: the truth, more cost a fit each.
FOLLOWED = 4
#: Squared sigmas beyond noise above which a first-order expansion around a fit is not informative.
FAR = 3000.0
#: Squared sigmas left unexplained by the right model, from noise and differing repeats: below it a fit explains the
#: runs, a run is not examined, and a hypothesis so near to the best may still win.
NOISE_LEAVES = 300.0
#: Longest step of a linear prediction in u, a unit of which is a factor e in what is searched by its logarithm.
LONGEST_STEP = 3.0
#: Strength in units of a law's scale for first-order expansions: small but not zero, as gas of no volume has no spring
#: and a line without delay no state.
FAINT = 0.01
#: Points drawn from the priors of a base and from the posterior of a coarse fit (a Sobol set covers them evenly with a
#: power of two), and by how much the latter is widened: 3 and 10 reached the best minimum in three of three
#: cases in which the base's fit had been stuck, 1 in two.
DRAWN, WIDENED = 64, 10.0
#: Step of a numerical derivative in u, a unit of which is well seen or a factor e: the cube root of a simulation's
#: accuracy of some 1e-10, where truncation and rounding of a central difference are alike (Press et al., Numerical
#: Recipes, section 5.7).
STEP_U = 4e-4
#: A derivative's cost in plain simulations (`python -m tests.benchmarks.derivatives`: 16 cost 4 to 5), and after how
#: many evaluations of the equations, derivatives at that cost, a straw's search ends with what it has found. 13 opened
#: cases that spent 64 million, or nearly, end alike with 48 (README of the benchmarks), which take 170 s of two threads
#: on two idle cores where 180 are asked (`python -m tests.benchmarks.diagnosing`).
COLUMN_COSTS, MOST_WORK = 0.25, 4.8e7

# -- reporting -------------------------------------------------------------------------------------------------------

#: Samples examined together for differences beyond noise, and the threshold of their sum of squares in standard
#: deviations: exceeded once in three million by chance.
BLOCK, BEYOND = 24, 5.0
#: Largest number of constants that count against a hypothesis; those with more are tables with priors of their own.
MOST_COUNTED = 4
#: Probability that the surviving set of hypotheses must cover, of what the search can be certain of.
COVERED = 0.95
#: A hypothesis this probable is named alone; otherwise the surviving set is named. The expected loss is least with
#: 1 - 1/5 where a wrong name costs five times as much as an open question.
NAMED_ALONE = 0.8
#: A second cause is accepted when fewer simulated campaigns with the first alone than this give one by chance: a false
#: pair may be named in one of fifty.
BY_CHANCE = 0.02
#: Squared sigmas that are one deviation of a constant: 22 make 13 instruments' constants of right answers by the
#: present search as far off as stated, 20 to 25 those of three decks when they were opened (22 constants). With the two
#: final decks' when opened, a few of them far off, it would be 500 and more (`python -m tests.benchmarks.sealed`).
ONE_DEVIATION = 20.0
#: An RMS is worse when it is larger by this factor: noise that lasts 50 ms leaves some 60 independent samples in a run
#: of a few seconds, so an RMS has a standard deviation of 1 / sqrt(120) = 9 %, and this is three of them.
WORSE = 1.27
