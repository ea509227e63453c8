"""Speed of the pictures behind the sliders: each is to answer within a second. Nothing passes."""

from importlib import import_module

from matplotlib import pyplot as plt
from timing import best_of

from seanav._pictures import live
from seanav.exercises import CHAPTERS


def main():
    for chapter, name in enumerate(CHAPTERS):
        if chapter:  # the foundations draw theirs in the notebook
            picture = import_module(f"seanav.studies.{name}.explore").picture

            def drawn(picture=picture):
                live(picture())
                plt.close("all")

            drawn()  # the kernels are compiled or read from their cache
            print(f"explore {chapter}: {best_of(drawn, 3)[0]:.2f} s with its drawing")


if __name__ == "__main__":
    main()
