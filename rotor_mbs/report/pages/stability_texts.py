"""Texts of the stability pages, in English. Knows numbers and names, not where they come from."""

from __future__ import annotations

from collections.abc import Sequence

TITLE = "Stiff and extreme cases: where each method holds"
LEAD = (
    "Each row is a scene made to break something, each column a method at its default settings. A mark says how "
    "the run came out, judged from its state: finite, end reached, energy balance, joints closed, distance to a "
    "quad-precision reference up to the horizon. What an engine says of its own run counts only against it. "
    "The last column names the method that stays within 10⁻⁶ rad of the reference up to the horizon in the least time."
)
MAP, SUMMARY, LIMITS, KEPT, KEY = "The map", "What to use each method for", "Largest stable step", "Conservation", "Key"
SCENE, METHOD, OUTCOME, REASON = "Scene", "Method", "Outcome", "Why"
RIGHT_BY = "Fastest to 10⁻⁶ rad"
NOBODY = "no method"
NO_REFERENCE, NOT_COMPARED = "no reference", "horizon before the second sample"
ANGLE_ERROR, ENERGY_DRIFT, RUN_TIME, STEP = "angle error (rad)", "energy drift", "run time (s)", "step for 1e-6 rad (s)"
REACHED = "reached (s)"
VERDICTS = "How each method came out"
MOTION, ERRORS, STEPS = "Motion", "Errors over time", "Error over the step"
DIFFERENCE_CAPTION = "Largest angle difference from the reference"
ENERGY_CAPTION = "Energy error as a share of the energy scale"
GAPS_CAPTION = "Largest position gap in a joint of the chain"
STEPS_CAPTION = "Largest angle error up to the horizon over the fixed step; no mark where the run failed"
GAP_AXIS, STEP_AXIS, STEP_ERROR_AXIS = "largest joint gap (m)", "step (s)", "largest angle error (rad)"
MEASURED, THEORY, RATIO, SCALED, DAMPING = (
    "found by bisection (s)",
    "theory (s)",
    "found / theory",
    "step × |λ|",
    "damping ratio of λ",
)
LIMITS_NOTE = (
    "Largest step with which no pitch grows a hundredfold in 5000 radians of the fastest mode, found by bisection"
    " on runs; theory: the method's stability function under the same rule. RK44: 2.828 on the imaginary axis "
    "(damping ratio 0), 2.785 on the negative real axis (1). RK67 grows on the whole imaginary axis, slowly at small "
    "steps: its limit depends on the length of the run. Generalized-α has no limit on linear problems."
)
KEPT_COLUMNS = {
    "angular_momentum_drift": "angular momentum (relative)",
    "mirror_error": "mirror image (rad)",
    "relabelling_error": "blades renumbered (rad)",
    "reversal_error": "there and back (rad)",
    "exponent": "growth exponent of energy drift",
}
KEPT_NOTE = (
    "Growth exponent: of the root-mean-square energy error over 64 perturbed starts; 0.5 is a random walk of "
    "round-off, 1 a steady loss. Angular momentum about the shaft is kept without gravity."
)
FAMILIES = {
    "stiff": "stiff",
    "light": "light",
    "singular": "singular",
    "fast": "fast",
    "long": "long",
    "needle": "on a needle",
    "scale": "out of scale",
}


def false_successes(count: int) -> str:
    if not count:
        return "No engine claimed success where the state says otherwise."
    times = "once" if count == 1 else f"{count} times"
    return (
        f"Engines claimed success {times} where the state says otherwise; no such run is labelled ok, each is marked."
    )


def motion_caption(method: str, unresolved: Sequence[str]) -> str:
    told = f"Angles and rates of {method}"
    if not unresolved:
        return told
    names = " and ".join([", ".join(unresolved[:-1]), unresolved[-1]]) if len(unresolved) > 1 else unresolved[0]
    return f"{told}. The samples are too far apart to show the swings of {names}: of those lines only the reach is true"


def conditioning(scene: str, uncertainty: float, growth: float) -> str:
    """Round-off of the start, 1e-16 rad, grown past 1e-6 rad is nothing that a method could help."""
    told = (
        f"{scene}: no method reaches 1e-6 rad. The reference is certain to {uncertainty:.1e} rad, and an error of the "
        f"start has grown {growth:.1e}-fold by the end: "
    )
    return told + ("this lies in the problem, not in a code." if growth >= 1e10 else "this lies in the methods.")
