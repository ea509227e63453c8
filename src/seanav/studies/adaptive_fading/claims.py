"""What paper 3 claims, in its own words, and how we read it."""

from seanav.claims import Claim

CLAIMS = (
    Claim(
        number="3.1",
        quote="with OKF the mentioned statistical tests can be used to detect the actuator faults "
        "in the system",
        section="section IV.A",
        reading="After the fault the optimal filter's β exceeds its threshold at least twice as "
        "often as by chance; the factor of two is ours",
        shown=("figure_02", "figure_D2", "figure_B2"),
    ),
    Claim(
        number="3.2",
        quote="the OKF is affected from actuator fault and diverges by time",
        section="section IV.A, abstract",
        reading="Its RMSE after the fault is above that without one, and the heading's grows at "
        "least 1.5 times from one fifth of the run to the next; the 1.5 is ours",
        shown=("figure_03", "figure_B1"),
    ),
    Claim(
        number="3.3",
        quote="AFKF with SFF is insensitive to actuator faults … fault detection algorithm results "
        "stay under the threshold values",
        section="sections IV.B and IV.C",
        reading="With the single factor, β after the fault is above its threshold in at most α of "
        "the samples, before the adaptation (which decides) and after it",
        shown=("figure_04",),
    ),
    Claim(
        number="3.4",
        quote="the adaptive filter gives better results compared to that of the OKF",
        section="section IV.B",
        reading="With the single factor the RMSE of every state after the fault is below the "
        "optimal filter's, in every setting",
        shown=("figure_05", "table_T2", "table_T4"),
    ),
    Claim(
        number="3.5",
        main=True,
        quote="AFKF with MFF is insensitive to actuator faults … the results of the adaptive "
        "filter with multiple factor are also better from that of the OKF",
        section="section IV.C",
        reading="With multiple factors β stays under its threshold as in 3.3, and the RMSE of "
        "every state is below the optimal filter's as in 3.4",
        shown=("figure_06", "figure_07", "table_T2", "table_T4"),
    ),
    Claim(
        number="3.6",
        quote="the results obtained from AFKF with MFF are better than the AFKF with SFF results",
        section="section IV.C",
        reading="At equal μ, and against the single factor as printed (μ = 1), multiple factors "
        "have the smaller RMSE in every state, and win most random settings",
        shown=("table_T4", "table_T6", "figure_B5"),
    ),
    Claim(
        number="3.7",
        quote="the estimations are corrected without affecting the characteristic of the accurate "
        "ones",
        section="abstract, section III.B, section V",
        reading="Before the fault the RMSE (geometric mean of the states) is within one per cent "
        "of the optimal filter's; the per cent is ours",
        shown=("table_T2", "figure_B3"),
    ),
    Claim(
        number="3.8",
        quote="This approach does not require … past time data. Moreover, computational demands "
        "are not high",
        section="section V",
        reading="No earlier innovation is kept, and a step takes at most twice the optimal "
        "filter's multiplications; the factor of two is ours",
        shown=("table_T8",),
    ),
    Claim(
        number="3.9",
        quote="the application of proposed algorithm to AUV fault tolerant steering and diving "
        "control system is beneficial",
        section="section V",
        reading="In both planes the RMSE of every state after the fault is below the optimal "
        "filter's",
        shown=("table_T2", "table_T3", "table_T4"),
    ),
    Claim(
        number="3.10",
        quote="is insensitive to actuator faults … The adaptive filter estimation values converge "
        "to the real values",
        section="sections IV.B and IV.C",
        reading="RMSE at most a tenth above that without a fault, at most 5 % of the squared error "
        "common to all runs, NEES within a tenth of the number of states",
        shown=("figure_05", "figure_07", "figure_B6", "table_T7"),
    ),
    Claim(
        number="3.11",
        quote="In the normal operation conditions of AUV, conventional Kalman filter gives "
        "sufficiently good estimation results",
        section="abstract, section I",
        reading="Before the fault the optimal filter's mean NEES is the number of states, within "
        "two standard errors",
        shown=("table_T7",),
    ),
    Claim(
        number="3.12",
        quote="The proposed AFKFs are considerably simpler than the existing",
        section="section I",
        reading="A step takes fewer multiplications than innovation-based adaptation with the same "
        "window, and than the fewest filters in parallel, two",
        shown=("table_T8",),
    ),
    Claim(
        number="3.13",
        quote="when a change occurs in the process noise covariance, the filter fails and the "
        "estimation outputs become faulty … the estimations of the filter are corrected",
        section="section III.B",
        reading="If the true Q grows hundredfold, the optimal filter is a tenth worse than one "
        "that knows it, and the fading ones beat it; both numbers are ours",
        shown=("table_T9",),
    ),
    Claim(
        number="3.14",
        quote="If condition (24) is met, then the real filtration error exceeds the theoretical "
        "error",
        section="section III.B.1",
        reading="While the vehicle is healthy, rule (24) is met in at most α of the samples",
        shown=("table_T5",),
    ),
    Claim(
        number="3.15",
        quote="due to the scale matrix or fading matrix the covariance of the estimation error of "
        "AFKF increases in comparison with OKF",
        section="section III.B.2",
        reading="P of the fading filters is nowhere below the optimal filter's, and its trace "
        "after the fault is larger",
        shown=("table_T10",),
    ),
    Claim(
        number="3.16",
        quote="This will lead to the decrease of innovation sequence … and adaptive factor …, "
        "weakening of the corrective influence",
        section="section III.B.1",
        reading="The factor's mean excess over one falls at least to half from the first fifth of "
        "the run after the fault to the last; fifth and half are ours",
        shown=("table_T10",),
    ),
    Claim(
        number="3.17",
        quote="Proposed adaptive KF will ensure the guaranteed adaptation of the filter to the "
        "change of the measurement system operation conditions",
        section="section III.B.1",
        reading="In random settings a fading filter is clearly worse than the optimal one no "
        "oftener than a 95 % interval errs by chance, 2.5 %",
        shown=("table_T6",),
    ),
    Claim(
        number="3.18",
        quote="This statistical function has χ2 distribution with s degree of freedom",
        section="section III.B.2",
        reading="While healthy, β exceeds the threshold in α of the samples, within two standard "
        "errors, in the optimal filter and before adaptation in the fading ones",
        shown=("figure_02", "figure_04", "figure_06"),
    ),
    Claim(
        number="3.19",
        quote="theoretical covariance matrix can be made adaptive … by converging to actual "
        "covariance matrix of innovation series",
        section="section V, section III.B.1",
        reading="After the fault the mean of β after adaptation is the number of measurements, "
        "within a tenth; the tenth is ours",
        shown=("table_T10",),
    ),
    Claim(
        number="3.20",
        quote="When there is an actuator fault, the real error will exceed the theoretical one",
        section="section III.B.2",
        reading="After the fault the optimal filter's mean NEES is above the number of states",
        shown=("table_T7",),
    ),
    Claim(
        number="3.21",
        quote="the filter gain matrix K(k) increases too, which will cause strengthening of the "
        "corrective influence of innovation sequence",
        section="section III.B.1",
        reading="After the fault the trace of H K is larger in a fading filter than in the optimal "
        "one",
    ),
    Claim(
        number="3.22",
        quote="This approach does not require the statistical feature of premise fault",
        section="section V",
        reading="Whatever the fault (loss, reversal, half), the RMSE after it is below the optimal "
        "filter's, without a change of the filter",
    ),
)
