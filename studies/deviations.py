"""Where what is flown here differs from the paper, each with its reason."""

from __future__ import annotations

PLANT: dict[str, tuple[str, ...]] = {
    "double-integrator": (
        "Plant: the paper's own prediction model, six double integrators with the acceleration "
        "reached at once; nothing of a vehicle is in it, so that the constraints are compared "
        "and nothing else.",
        "λ = 0.4, k_S = 8, slack penalty 200, no node skipped: without a fast loop the MPC alone "
        "meets the disturbance, and eq 25 needs λ ≥ d(1 + k_S T/2)/γ = 0.373 in sampled data.",
    ),
    "full": (
        "Plant: the exact coupled vehicle and arm with rotor lag instead of the printed eq 6, "
        "whose constant mass matrix neglects the moving centre of mass and counts the links "
        "twice.",
        "Fast loop: 500 Hz tracking of the MPC's plan for every controller; `--tracking pid` flies "
        "the paper's PIDs instead.",
        "c_s and c_e are those of the MPC's inputs, as in the paper. Where the MPC plans from its "
        "own plan, the fast loop meets the disturbance and its effort is not in them.",
        "Prediction: the MPC knows the attitude's lag. blf-no-lag is what the paper prints, "
        "prediction without lag over PIDs, with our λ.",
    ),
}

_COMMON = (
    "Trajectories: the paper does not print its own; ours are Lissajous figures of 120 s, in Case "
    "I 30 mm into the safety zones of the walls, so that safety has a price in TE (floor in the "
    "JSON).",
    "Completion: the margin to the safe set stays ≥ 0 in the plant's truth between samples as "
    "well, over the whole flight; the paper judges one flight and does not say how.",
    "TE averages over flights, also over those that did not complete, up to their collision if "
    "they had one; the paper marks these with *.",
    "c_s and c_e: the paper defines sums over 1200 steps, but its numbers are far below any such "
    "sum; the table shows means per step, the JSON has both.",
    "l2 penalises v_e − v_d instead of the printed v_e, which pulls a moving end-effector back; "
    "all controllers here have it.",
    "An input cost of 0.02, a yaw acceleration limited to 0.1 rad/s² and a cone for the tilt are "
    "ours; the paper gives no input bounds.",
)

TABLE_4: tuple[str, ...] = (
    *_COMMON,
    "MPC-BLF: the signs of eqs 22 and 23 are corrected, the root is continued linearly at the "
    "boundary, and the rows have an exact penalty; γ = 3 is the paper's, α = 2 and z = 1 are not "
    "printed there.",
    "λ: the paper's 5 cannot hold as a hard condition (the centre of the sphere at rest would need "
    "α ≥ 167 m/s²); it is flown softly as blf-lambda-5, beside ours.",
    "MPC-SC: eq 29 is one-sided; as printed it pushes deeper once s_min is passed. With the "
    "weights of Table II in the denominator, as printed, it keeps so far from the walls that it "
    "never collides and hardly tracks; the paper's TE and its collision are not reproduced.",
    "MPC-HC keeps 1 mm more than the safe set: without it, its calm flights fail by micrometres of "
    "solver tolerance and of curvature between nodes.",
    "MPC-HC without a solution: the last plan goes on and then brakes; the paper ends the flight "
    "there.",
    "Calm air has no random number in it: one flight stands for every seed, and the interval is "
    "that of one flight.",
    "Like-for-like gives the rivals what blf has: HC the same slack and the same skipped node, "
    "also tightened by 80 mm (I) or 50 mm (II); Naive a centring cost in the sphere. Where these "
    "pass, the barrier is one way among several to stay inside.",
)

TABLE_3: tuple[str, ...] = (
    *_COMMON,
    "T_C is the median processor time of one planning step with Clarabel on this machine; the "
    "paper used SLSQP with numeric gradients on an i7-8550U.",
    "λ = 1 and 5 are infeasible as hard conditions in a sphere of 75 mm and act through the "
    "penalty, as centring; ours is beside them.",
    "n = 1 on the full plant: the inputs can hardly move the vehicle within one period of lag.",
)

ROBUSTNESS: tuple[str, ...] = (
    "The paper claims rejection of d_m = 0.8 m/s² only; everything here is on top of it.",
    "Latency: 6 ms instead of 5, because the link exchanges values every 2 ms; it applies to "
    "every sensor, and the flight software does not know of it.",
    "Noise per sample at 500 Hz, white: 1 mm, 1 cm/s, 0.2°, 0.2 °/s on pose and rates, the same "
    "angles on the joint encoders.",
    "Grazing path: Case I with a reference that touches the safety zones instead of entering them "
    "by 30 mm, so that nothing but the stand-off keeps TE from zero.",
    "Impulses: 1.6 m/s² for 0.1 s in a random direction, every 5 s on average.",
)

SPHERE: tuple[str, ...] = (
    "The paper flies r = 0.075 m only, the largest sphere straight above the end-effector that "
    "both elbows together can serve.",
    "λ, gains and weights stay those of r = 0.075 m.",
)

FIGURES: tuple[str, ...] = (
    "One flight a controller, with the first seed; the paper's comparison.",
    "Trajectories are ours: the paper does not print its own.",
)

FIGURE_2: tuple[str, ...] = (
    "The set is computed from the joint limits of Table I. A sphere of 75 mm straight above at "
    "0.225 m fits only if the arm may use both elbows; with one elbow 48 mm fit there.",
)
