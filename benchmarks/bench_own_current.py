"""Speed of paper 4 on an own current: missions, all filters, exact beliefs. Nothing fails."""

from timing import best_of

from seanav.studies.imm_sea_current import tidal
from seanav.studies.imm_sea_current.scenario import Scenario


def main():
    scenario = Scenario(current_missions=24)
    sea = tidal.sea(scenario)
    rows = [
        ("24 two-hour missions, all filters", 10.0, lambda: tidal.fly(scenario, sea)),
        ("exact numbers of all beliefs", None, lambda: tidal.exact(scenario, sea)),
    ]
    print(f"{'what':40} {'wall (s)':>10} {'CPU (s)':>10} {'target (s)':>11}")
    for what, target, function in rows:
        wall, cpu = best_of(function, 1)
        print(f"{what:40} {wall:10.4f} {cpu:10.4f} {target or '':>11}")


if __name__ == "__main__":
    main()
