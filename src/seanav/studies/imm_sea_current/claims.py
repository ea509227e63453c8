"""Paper 4: what it claims.

Numbers 4.1 to 4.17 stand in the order in which they were first tested; the later ones follow
the sections of the paper.
"""

from seanav.claims import Claim

_RESULTS, _PROPOSED, _MODEL = "section 4.2.1", "section 4.2.2", "Appendix B"

_CONVENTIONAL = (
    Claim(
        number="4.1",
        quote="the pure navigation results in Figure 3(a) shows constant performance "
        "regardless of sea current model",
        section=_RESULTS,
        reading="its TCEP is the same at both ends of the domain",
        shown=("figure_03",),
    ),
    Claim(
        number="4.2",
        quote="in the case of the optimal EKF, the performance deteriorates as the standard "
        "deviation of the sea current increases",
        section=_RESULTS,
        reading="its TCEP rises from every point of the grid to the next",
        shown=("figure_03",),
    ),
    Claim(
        number="4.3",
        quote="The TCEPs of suboptimal EKF are the same with those of the optimal EKF at "
        "σ_T = σ_f and larger elsewhere",
        section=_RESULTS,
        reading="where σ_f is not σ_T the TCEP exceeds that of the EKF with σ_f = σ_T",
        shown=("figure_03",),
    ),
    Claim(
        number="4.4",
        quote="the performance degradation is particularly greater where σ_T > σ_f than in the "
        "opposite case",
        section=_RESULTS,
        reading="of two values, filter and sea exchanged, expecting the smaller one costs more "
        "points of rate",
        shown=("figure_03",),
    ),
    Claim(
        number="4.5",
        quote="when σ_T > σ_f, the performance of EKF-based sea current relative navigation is "
        "inferior to that of the pure navigation",
        section=_RESULTS,
        reading="the rate is negative, literally for every σ_T > σ_f; or, if “≫” was lost in our "
        "copy, from σ_T = 10 σ_f on (ten is ours)",
        shown=("figure_03", "table_B6"),
    ),
)

_FADING = (
    Claim(
        number="4.6",
        quote="the degradation of navigation performance is reduced in the large σ_T domain",
        section=_PROPOSED,
        reading="at the largest σ_T the AFEKF has a smaller TCEP than the EKF of the same σ_f",
        shown=("figure_04", "table_3"),
    ),
    Claim(
        number="4.7",
        quote="the EKF-based ones show slightly better performance than do the AFEKF-based ones",
        section=_PROPOSED,
        reading="at the smallest σ_T fading costs TCEP, but not over 10 % of it (10 % is ours)",
        shown=("figure_04", "table_2"),
    ),
    Claim(
        number="4.8",
        main=True,
        quote="more robust than the single models, maintaining high TCEP improvement of 90% rate "
        "in all σ_T domain",
        section=_PROPOSED,
        reading="the rate of the IMM-AFEKF is at least 90 % at every point of the grid",
        shown=("figure_05", "figure_B6", "figure_B7"),
    ),
    Claim(
        number="4.9",
        quote="the IMM filter with σ_f,2 = 0.5 m/s has a better performance than that with "
        "σ_f,2 = 1.0 m/s due to the adaptive fading scheme",
        section=_PROPOSED,
        reading="a higher rate for 0.1 < σ_T < 1, and IMMs of plain EKFs show less of it",
        shown=("figure_05", "figure_B8"),
    ),
    Claim(
        number="4.10",
        quote="When σ_T is small, as detailed in Table 2, … the navigation errors of single model "
        "filters with small σ_f are satisfactory",
        section=_PROPOSED,
        reading="every cell agrees within two standard errors of both, at 100 runs each",
        shown=("table_2",),
    ),
    Claim(
        number="4.11",
        quote="as detailed in Table 3, the performance of those single-model filters with small "
        "σ_f rapidly deteriorates",
        section=_PROPOSED,
        reading="every cell agrees within two standard errors of both, at 100 runs each",
        shown=("table_3",),
    ),
    Claim(
        number="4.12",
        quote="the mode probability of sub-filter 1 decreases rapidly … the greater the difference "
        "between σ_f,1 and σ_f,2, the greater the difference of mode probabilities",
        section=_PROPOSED,
        reading="μ₁ falls from each point to the next; with the larger σ_f,2 the better model "
        "leads by more, at both ends",
        shown=("figure_06",),
    ),
    Claim(
        number="4.13",
        quote="the computation complexity is naturally increased … the increased computational "
        "cost should not be a major concern",
        section=_PROPOSED,
        reading="an IMM takes over 1.5 times an EKF's time, fading adds less than half, and a "
        "2 h mission takes under 1 s (thresholds ours)",
    ),
    Claim(
        number="4.14",
        quote="none of the single model AFEKFs shows a prominent performance in the entire σ_T "
        "domain",
        section=_PROPOSED,
        reading="far from its σ_f each has a rate below the 90 % that the paper asks of the IMM",
        shown=("figure_04",),
    ),
    Claim(
        number="4.15",
        quote="Among the two parameters T_c and σ …, the latter further affects filter performance",
        section="section 4.1",
        reading="a σ_f that is wrong by a factor costs more TCEP than a T_c wrong by the same one",
        shown=("figure_B5",),
    ),
    Claim(
        number="4.16",
        quote="it can reduce the effect of the Schuler period …, which appears in general indices "
        "such as RMS error and CEP",
        section=_RESULTS,
        reading="while the RMS of pure navigation falls by 5 % or more in its Schuler swing, the "
        "TCEP falls by less (5 % is ours)",
        shown=("figure_B4",),
    ),
    Claim(
        number="4.17",
        quote="P₁₁⁻ is independent of the sea current model by Equation (10)",
        section=_MODEL,
        reading="before an update it is the same for σ = 0.1 and 1 m/s within 1 % (1 % is ours)",
        shown=("figure_B3",),
    ),
)

_FIRST_SECTIONS = (
    Claim(
        number="4.18",
        quote="since v_u > v holds, Equation (2) can be rewritten as Equation (3)",
        section="section 2.1",
        reading="the error of (3) stays below the noise of the log, as it is and once its scale "
        "is calibrated at 20 kn (the bound is ours)",
    ),
    Claim(
        number="4.19",
        quote="Equation (11) generates a correlation between the INS error and the sea current "
        "which are independent at time propagation process as shown in Equation (10)",
        section="section 2.3.2",
        reading="errors of velocity and current ahead are uncorrelated at the start, and have a "
        "positive correlation after one update (above 0.01, ours)",
    ),
    Claim(
        number="4.20",
        quote="it inflates a priori covariance but does not particularly adjust the Kalman gain",
        section="section 3.1",
        reading="an AFEKF with (17) as it is written, where the factor γ inflates P and leaves the "
        "gain as it is, navigates better than without the log",
        shown=("table_B1",),
    ),
    Claim(
        number="4.21",
        quote="since the conversion between sea current models does not occur frequently, T = […] "
        "is set",
        section="section 4.1",
        reading="at one step a second the matrix (damaged in our copy) keeps a model for T_c, two "
        "hours, at least (T_c is our measure)",
    ),
)

_PERFORMANCE = (
    Claim(
        number="4.22",
        quote="the adaptive fading technique is effective for cases when σ_f < σ_T, as in Table 3",
        section=_PROPOSED,
        reading="for every σ_T > σ_f of the grid the AFEKF has a smaller TCEP than the EKF",
        shown=("figure_04",),
    ),
    Claim(
        number="4.23",
        quote="the proposed IMM-AFEKF filter shows the most robust navigation performance in all "
        "domains of σ_T",
        section=_PROPOSED,
        reading="its least rate over the grid is higher than that of every single-model filter",
        shown=("figure_03", "figure_04", "figure_05"),
    ),
    Claim(
        number="4.24",
        quote="the performance discrepancy between the proposed and the best is insignificant",
        section=_PROPOSED,
        reading="no column of Tables 2 and 3 exceeds that of the best filter there by over 10 % "
        "(10 % is ours)",
        shown=("table_2", "table_3", "table_B2"),
    ),
    Claim(
        number="4.25",
        quote="the filter that performs best in one case has the worst performance in the other "
        "case",
        section=_PROPOSED,
        reading="position: EKF 0.1 is best in Table 2 and worst in Table 3, AFEKF 0.5 the reverse",
        shown=("table_2", "table_3"),
    ),
    Claim(
        number="4.26",
        quote="in the σ_T domain where the performance of one sub-filter is degraded, the other "
        "sub-filter compensates for it",
        section=_PROPOSED,
        reading="at every σ_T the IMM has a smaller TCEP than the worse of its sub-filters alone",
        shown=("figure_04", "figure_05"),
    ),
    Claim(
        number="4.27",
        quote="it may be more appropriate to use a specific single filter when changes of the sea "
        "current velocity can be predicted accurately",
        section=_PROPOSED,
        reading="the EKF that knows σ_T beats the IMM-AFEKF at every point: a rate below 100 %",
        shown=("figure_05",),
    ),
    Claim(
        number="4.28",
        quote="It was confirmed that the results were consistent with the previous analysis",
        section=_PROPOSED,
        reading="if the paper's filters met the same noise: its ratios of position errors to EKF "
        "0.1 agree with our paired ones",
        stated=False,
        shown=("table_B2",),
    ),
    Claim(
        number="4.29",
        quote="due to the adaptive fading scheme, it showed superior performance even when the "
        "standard deviations of the sub-filters were set smaller than the actual value",
        section="section 5",
        reading="for σ_T above both σ_f the IMM of AFEKFs has a higher rate than one of plain EKFs",
        shown=("figure_B8",),
    ),
    Claim(
        number="4.30",
        quote="a more meticulously designed transition probability matrix will improve the filter "
        "performance",
        section="section 5",
        stated=False,
        reading="with p = 0.95 or 0.98 on the diagonal the least rate is higher than with the "
        "paper's T",
        shown=("figure_B6",),
    ),
    Claim(
        number="4.31",
        quote="the variance for the velocity of the vehicle can be obtained as Equation (B3)",
        section=_MODEL,
        reading="(B3) gives what the Kalman filter's recursion gives, within rounding",
    ),
    Claim(
        number="4.32",
        quote="as the standard deviation of sea current increases, P₁₂⁻ and P₂₂⁻ increase "
        "consequently",
        section=_MODEL,
        reading="before an update both are larger for σ = 1 than for 0.1 m/s",
        shown=("figure_B3",),
    ),
    Claim(
        number="4.33",
        quote="even if the filter was optimally designed, the guaranteed performance improvement "
        "due to the aid of an EM-log or a DVL inevitably decreases",
        section=_MODEL,
        reading="after an update P₁₁ is larger for σ = 1 than for 0.1 m/s",
    ),
    Claim(
        number="4.34",
        quote="Despite being more robust than EKF, AFEKF with a single model still has a limited "
        "range",
        section="section 1",
        reading="of one σ_f, the least rate over the grid is higher with fading than without",
        shown=("figure_03", "figure_04"),
    ),
    Claim(
        number="4.35",
        quote="when σ_f is set small, a prominent performance is shown in the domain where σ_T is "
        "also small",
        section=_PROPOSED,
        reading="where σ_T is its σ_f an AFEKF has a rate of 90 % at least (the paper's figure for "
        "the IMM)",
        shown=("figure_04",),
    ),
)

CLAIMS = (*_CONVENTIONAL, *_FADING, *_FIRST_SECTIONS, *_PERFORMANCE)
