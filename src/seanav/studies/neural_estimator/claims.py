"""Paper 2: what it claims, in its words and in ours; thresholds named "ours" are not its own."""

from seanav.claims import Claim

CLAIMS = (
    Claim(
        number="2.1",
        quote="Kalman filter functions correctly in the period of stable work, but it shows "
        "considerable discrepancies in the initial estimation period",
        section="section 2",
        reading="In steps 1 to 19 GLS has a smaller RMSE than KF, from a start at the first "
        "measurement and from zero; no start is given.",
    ),
    Claim(
        number="2.2",
        quote="decidedly the best results have been obtained by applying the intermediate "
        "estimation method",
        section="section 5",
        reading="Over all steps of a course the intermediate method beats KF and GLS, at w1 = 0.3 "
        "(ours) and at the best inner w1.",
        shown=("table_3", "figure_B1"),
    ),
    Claim(
        number="2.3",
        main=True,
        quote="In most cases the neural filter gave better results than the numerical filter",
        section="section 5",
        reading="The network has the smaller error than its teacher in over half of all runs and "
        "courses, pooled; frozen and re-taught.",
        shown=("table_1", "table_2", "figure_06"),
    ),
    Claim(
        number="2.4",
        quote="A multilayer perceptron has been applied …, consisting of the input layer, one "
        "hidden layer (100 neurons) and the output layer",
        section="section 5",
        reading="No other hidden size has a smaller RMSE where the network is of any use: where "
        "it beats the measurement itself.",
        stated=False,
        shown=("table_4", "figure_B2"),
    ),
    Claim(
        number="2.5",
        quote="This method became the “teacher” of the neural network",
        section="section 3",
        reading="A network taught by the intermediate method has a smaller RMSE than one taught "
        "by KF or by GLS, where it is of any use.",
        stated=False,
        shown=("table_5",),
    ),
    Claim(
        number="2.6",
        quote="A variant was also examined, where the teaching sequence is exchanged with network "
        "outputs. This variant was called network self-learning",
        section="section 3",
        reading="It works: the self-taught network beats the frozen one and the measurement "
        "itself, where a network is of any use.",
        stated=False,
        shown=("table_1", "table_2"),
    ),
    Claim(
        number="2.7",
        quote="the initial weights among particular neurons are chosen at random, which has "
        "decisively influences the final effect of the teaching process",
        section="section 3",
        reading="At least half (ours) of the variance of a run's squared error comes from the "
        "draw of the weights.",
    ),
    Claim(
        number="2.8",
        quote="as many times as the (delta) error is smaller than the assumed one, i.e. Δ = 0.001",
        section="section 3",
        reading="Teaching ends because its error falls below Δ, in 95 % (ours) of the runs, by "
        "each of three readings of the error.",
        shown=("table_6", "figure_B3"),
    ),
    Claim(
        number="2.9",
        quote="in real conditions a hybrid adaptive system would work best",
        section="section 5",
        stated=False,
        reading="Our hybrid beats teacher, networks and the variable w1 (no network) in the "
        "examination of each course.",
        shown=("table_1", "table_B2", "table_B6"),
    ),
    Claim(
        number="2.10",
        quote="A smooth change in the weight coefficients should allow to use the merits of both "
        "above-mentioned methods in the highest degree",
        section="section 2",
        reading="GLS beats KF in turns, KF beats GLS on the steady course, and the variable w1 "
        "beats both on each course.",
        shown=("table_1", "table_2"),
    ),
    Claim(
        number="2.11",
        quote="the possibility of obtaining a fast (parallel transformation) … Kalman filter",
        section="section 1",
        reading="The network takes at most as much arithmetic, or at most as many steps in "
        "parallel, as the Kalman filter.",
        shown=("table_B3",),
    ),
    Claim(
        number="2.12",
        quote="it was necessary to “supplement” the education of the network while the experiment "
        "lasts",
        section="section 3",
        reading="The re-taught network has a smaller RMSE in the examination than the frozen one.",
        shown=("table_1", "table_8"),
    ),
    Claim(
        number="2.13",
        quote="up to the moment of the estimation process stabilising. It was assumed that the "
        "stage would last one minute",
        section="section 3",
        reading="On a steady course the numerical filter's error after one minute is at most 10 % "
        "(ours) above the one it has for ever.",
        shown=("table_B7",),
    ),
    Claim(
        number="2.14",
        quote="The intermediate estimation method … showed the best convergence of the estimation "
        "process",
        section="section 3",
        reading="In steps 1 to 19 the intermediate method has a smaller RMSE than KF and GLS, "
        "from both starts.",
    ),
    Claim(
        number="2.15",
        quote="no basis for rejecting the hypothesis of the correctness of the constructed neural "
        "mathematical model",
        section="section 5",
        reading="The network's estimate is not worse than the measurement itself in the "
        "examination, frozen or re-taught.",
        shown=("table_1",),
    ),
    Claim(
        number="2.16",
        quote="when w1 = 0 the Kalman filter is obtained; in the case of w2 = 0, on the other "
        "hand, the generalized method of least squares",
        section="section 2",
        reading="At both ends the intermediate estimates equal those of KF and GLS, with the "
        "innovation as printed and as we read it.",
    ),
    Claim(
        number="2.17",
        quote="The numerical filter, which is assumed to fulfil this function, has itself big "
        "errors in the initial estimation stage",
        section="section 3",
        reading="The teacher's RMSE in steps 1 to 19 is at least twice (ours) its RMSE once it has "
        "settled on the steady course, from both starts.",
        shown=("table_B7",),
    ),
    Claim(
        number="2.18",
        quote="a continual exchange of the teaching sequence with new, more precise elements",
        section="section 3",
        reading="Under way the teacher's answers have a smaller RMSE than those of the first "
        "lesson had.",
        shown=("table_1",),
    ),
)
