"""Texts of the stability pages, in English. Knows numbers and names, not where they come from."""

from __future__ import annotations

TITLE = "Stiff and extreme cases: where each method holds"
LEAD = (
    "Each row is a scene made to break something, each column a method at its default settings. A mark says how "
    "the run came out, judged from its state: finite, end reached, energy balance, joints closed, distance to a "
    "quad-precision reference up to the horizon. What an engine says of its own run counts only against it."
)
MAP, SUMMARY, LIMITS, KEPT, KEY = "The map", "What to use each method for", "Largest stable step", "Conservation", "Key"
SCENE, METHOD, OUTCOME, REASON = "Scene", "Method", "Outcome", "Why"
RIGHT_BY = "1e-6 rad by"
NOBODY = "no method"
NO_REFERENCE = "no reference"
ANGLE_ERROR, ENERGY_DRIFT, RUN_TIME, STEP = "angle error (rad)", "energy drift", "run time (s)", "step for 1e-6 rad (s)"
REACHED = "reached (s)"
VERDICTS = "How each method came out"
MOTION, DIFFERENCE, ENERGY, GAPS, STEPS = (
    "Motion",
    "Difference from the reference",
    "Energy error",
    "Joint gaps",
    "Error over the step",
)
MOTION_CAPTION = "Angles and rates of {}"
DIFFERENCE_CAPTION = "Largest angle difference from the reference"
ENERGY_CAPTION = "Energy error of its scale"
GAPS_CAPTION = "Largest position gap in a joint of the chain"
STEPS_CAPTION = "Largest angle error up to the horizon over the fixed step; no mark where the run failed"
GAP_AXIS, STEP_AXIS, STEP_ERROR_AXIS = "largest joint gap (m)", "step (s)", "largest angle error (rad)"
MEASURED, THEORY, RATIO, SCALED, KIND = (
    "found by bisection (s)",
    "theory (s)",
    "found / theory",
    "step × |λ|",
    "fastest mode",
)
REAL, IMAGINARY = "negative real axis, or near", "imaginary axis, or near"
LIMITS_NOTE = (
    "Largest step with which no pitch grows a hundredfold in 5000 radians of the fastest mode, found by bisection"
    " on runs; theory: the method's stability function under the same rule. RK44: 2.828 on the imaginary axis, "
    "2.785 on the negative real axis. RK67 grows on the whole imaginary axis, slowly at small steps: its limit "
    "depends on the length of the run. Generalized-α has no limit on linear problems."
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
    return (
        f"Engines claimed success {count} times where the state says otherwise; none of these runs is labelled ok, "
        "and each is marked."
    )


def conditioning(scene: str, uncertainty: float, growth: float) -> str:
    return (
        f"{scene}: no method reaches 1e-6 rad. The reference is certain to {uncertainty:.1e} rad, and an error of the "
        f"start has grown {growth:.1e}-fold by the end: this lies in the problem, not in a code."
    )
