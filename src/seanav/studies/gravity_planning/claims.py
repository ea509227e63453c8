"""What paper 5 claims, in its own words, and how we read it."""

from seanav.claims import Claim

CLAIMS = (
    Claim(
        number="5.1",
        quote="regions with denser contours correspond to larger Mn. This suggests that more "
        "gravity information is available in such areas",
        section="section 4.1",
        reading="Over blocks of the map, the length of drawn contours ranks the places as their "
        "gradient does; a rank correlation of 0.8 is our threshold",
        shown=("figure_02", "figure_03"),
    ),
    Claim(
        number="5.2",
        quote="the RMSE converges fastest with the path length when sailing along the planned path",
        section="section 4.1",
        reading="In test 1 the RMSE at 20 km is smallest on the planned path",
        shown=("figure_03", "figure_04"),
    ),
    Claim(
        number="5.3",
        main=True,
        quote="the planned path remains the better choice as it exhibits the highest positioning "
        "accuracy",
        section="sections 4.1 and 4.2",
        reading="In both tests the planned path has a smaller sum of RMSE than the best of all "
        "other paths",
        shown=("figure_05", "figure_08", "table_2", "table_3"),
    ),
    Claim(
        number="5.4",
        quote="the trajectories near the planned path can also achieve high localization accuracy",
        section="section 4.1, abstract, section 4.3",
        reading="A path that bends 2 or 5.5 km away from the plan has a sum of RMSE at most a "
        "quarter larger; the quarter is our threshold",
        shown=("table_B10",),
    ),
    Claim(
        number="5.5",
        quote="increasing … noise … will not change the ranking …, so the planned trajectory "
        "always has higher positioning accuracy than the other curves",
        section="section 4.3, abstract",
        reading="At every R the planned path's sum of RMSE is the smallest, and the order of the "
        "paths is the same at the least and at the most noise",
        shown=("table_2", "table_3"),
    ),
    Claim(
        number="5.6",
        quote="with the increase of the measurement noise, the improvement … of the planned "
        "trajectory is more obvious",
        section="section 4.3",
        reading="The gain over the direct path, as a difference and as a ratio of the sums of "
        "RMSE, is larger at the most noise than at the least",
        shown=("table_2", "table_3"),
    ),
    Claim(
        number="5.7",
        quote="a path planning method with optimal navigation accuracy is proposed",
        section="abstract, section 5",
        reading="No path has a smaller sum of the bound's traces, the planner's own cost, than "
        "the path of A*",
        shown=("table_B2", "table_B3", "table_B6"),
    ),
    Claim(
        number="5.8",
        quote="the Kalman filter can obtain the optimal solution under the assumption of linear "
        "Gaussian white noise, and its state covariance can reach the PCRB",
        section="section 2",
        reading="On a plane map the filter's covariance and its errors are those of the bound; on "
        "the real map SITAN stays within our tenth of it",
        shown=("figure_05", "figure_08", "table_B7"),
    ),
    Claim(
        number="5.9",
        quote="can plan the trajectory with the minimum navigation error between any start and "
        "end points",
        section="section 5, section 1",
        reading="Any means any: of random pairs on three maps, none has a bow or a direct path "
        "with a smaller sum of the root PCRB than the plan's",
        shown=("figure_B1", "table_B5"),
    ),
    Claim(
        number="5.10",
        quote="The speed of convergence and convergence down line of the planned trajectory are "
        "significantly better than the other trajectories",
        section="section 4.2",
        reading="In test 2 the plan and its two neighbours have the smallest RMSE at 15 km, and "
        "the plan the lowest RMSE of all",
        shown=("figure_06", "figure_07", "figure_08"),
    ),
    Claim(
        number="5.11",
        quote="consuming just slightly more distance” and “the planned path intersects the region "
        "with maximum information",
        section="abstract and section 4.1",
        reading="Plans cross places in the upper tenth of M, gain between poor ends too, and are "
        "at most a fifth longer; tenth and fifth are our thresholds",
        shown=("figure_03", "figure_06", "table_B5"),
    ),
    Claim(
        number="5.12",
        quote="swiftly investigating a possible set of solutions …, which enables it to produce "
        "pathways fast",
        section="section 1",
        reading="The heuristic spares A* at least half of the map's nodes; the half is our "
        "threshold",
        shown=("table_B11",),
    ),
    Claim(
        number="5.13",
        quote="the distance factor is included in the INS error divergence variance. Hence, this "
        "method can plan the quickest path",
        section="section 1",
        reading="The INS's variance keeps the plan short: with Q it is at least one per cent "
        "shorter than without; the per cent is our threshold",
        shown=("table_B11",),
    ),
    Claim(
        number="5.14",
        quote="The PCRB is the estimated lower bound of position variance” and “the expectation E "
        "is computed only at the current true position",
        section="abstract and section 2",
        reading="A near-exact filter's sum of RMSE is nowhere below the sum of the root PCRB that "
        "is linearised at the truth",
        shown=("table_B8", "figure_B3"),
    ),
    Claim(
        number="5.15",
        quote="the RMSE of all paths decreases rapidly during the initial stage since the "
        "starting point 1 is located in a region with high Mn values",
        section="sections 4.1 and 4.2",
        reading="The more informative the start of a random pair, the smaller the direct path's "
        "bound after 15 km; our start 1 is not the paper's place",
        shown=("table_B12", "figure_04"),
    ),
    Claim(
        number="5.16",
        quote="the RMSE remains the lowest among all paths",
        section="section 4.1",
        reading="At 30, 40, 50 and 60 km the planned path of test 1 has the smallest RMSE of all "
        "paths that are as long",
        shown=("figure_04",),
    ),
    Claim(
        number="5.17",
        quote="This ensures that the carrier does not get lost, reducing the risk of losing the "
        "carrier significantly",
        section="section 4.1",
        reading="At most one run in a hundred ends lost on any of the plans and the paths up to "
        "5.5 km beside them; the hundredth is our threshold",
        shown=("table_B10",),
    ),
    Claim(
        number="5.18",
        quote="the positioning accuracy in the initial stage holds a significant influence on the "
        "RMSE of the entire path",
        section="section 4.2",
        reading="Over random pairs the bound at 15 km ranks the direct paths as its mean over the "
        "rest does; a correlation of 0.5 is our threshold",
        shown=("table_B12",),
    ),
    Claim(
        number="5.19",
        quote="increasing the amount of measurement noise will increase the lower limit of "
        "positioning error",
        section="section 4.3",
        reading="Along every path of both tests the sum of the root PCRB grows from each noise "
        "level to the next",
        shown=("table_B13",),
    ),
    Claim(
        number="5.20",
        quote="The optimality of the planned trajectory is not affected by gravimetric "
        "measurements, so that the planned trajectory can be navigated in one determined ocean "
        "mission",
        section="section 4.3",
        reading="A path planned anew for the noise that is met has a sum of RMSE at most a tenth "
        "smaller than that of the path planned once; the tenth is our threshold",
        shown=("table_B1",),
    ),
    Claim(
        number="5.21",
        quote="the planned trajectory covers approximately 10 km more distance” and “convergence "
        "accuracy stabilizing around 0.1 km after reaching 20 km",
        section="section 4.1",
        reading="Test 1: the same lengths on our map; they hang on a map whose place the paper "
        "does not name, so they are shown and not counted",
        shown=("figure_04",),
    ),
    Claim(
        number="5.22",
        quote="reaches minimum at 50 km” and “the sum of RMSE of the planned trajectory … is 42 km "
        "… L4 has the second-best performance, with an RMSE of 44 km",
        section="section 4.2",
        reading="Test 2: the same lengths on our map; they hang on a map whose place the paper "
        "does not name, so they are shown and not counted",
        shown=("figure_08",),
    ),
)
