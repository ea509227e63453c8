"""Build the environment of a checkout, unless it stands: what ``make .venv`` calls.

Make runs this file before every target that needs packages, with an interpreter that has
none yet and may be too old: it uses the standard library only.
"""

import ast
import fcntl
import hashlib
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

# What pip keeps of the user's settings: the way to a registry. All others (user, target,
# prefix, constraint, no-binary, ...) would put packages elsewhere or take other ones.
KEPT = ["index-url", "extra-index-url", "no-index", "find-links", "trusted-host", "use-feature"]
KEPT += ["cert", "client-cert", "keyring-provider", "proxy", "timeout", "default-timeout"]
KEPT += ["retries", "cache-dir", "no-cache-dir"]


def wanted(root: Path) -> dict:
    """Return what an environment in `root` is built for: folder, interpreter and lock."""
    lock = hashlib.sha256((root / "requirements.lock").read_bytes()).hexdigest()
    series = ".".join(map(str, sys.version_info[:2]))
    return {"folder": str(root), "Python": f"{series} in {sys.base_prefix}", "lock": lock}


def fault(root: Path) -> str:
    """Return why the environment in `root` must be built; empty if it stands."""
    now = wanted(root)
    try:
        built = json.loads((root / ".venv" / ".built").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return "there is none that was finished"
    if built["folder"] != now["folder"]:
        return f"this one was built in {built['folder']}"
    if built["Python"] != now["Python"]:
        return f"this one has Python {built['Python']}, not {now['Python']}"
    return "" if built == now else "requirements.lock has changed"


def build(root: Path) -> None:
    """Build ``.venv`` from the lock, unless it stands; a second make waits for the first."""
    if not fault(root):
        return
    (root / "build").mkdir(exist_ok=True)
    with (root / "build" / "environment.lock").open("w", encoding="utf-8") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print("waiting for another make that builds .venv", flush=True)
            fcntl.flock(lock, fcntl.LOCK_EX)
        reason = fault(root)
        if reason:
            print(f"building .venv anew, a few minutes: {reason}", flush=True)
            asked = wanted(root)  # before: the lock may change while packages are installed
            install(root / ".venv", "--require-hashes", "-r", root / "requirements.lock")
            mark(root, asked)


def mark(root: Path, built: dict) -> None:
    """Let the environment in `root` find the package, and say what it was `built` for."""
    (packages,) = (root / ".venv").glob("lib/python*/site-packages")
    # Relative: the environment of a copied checkout must not run the original's sources.
    (packages / "seanav.pth").write_text(
        os.path.relpath(root / "src", packages) + "\n", encoding="utf-8"
    )
    (root / ".venv" / ".built").write_text(json.dumps(built), encoding="utf-8")


def install(folder: Path, *what: object) -> None:
    """Make `folder` a fresh environment of this interpreter and install `what` there."""
    if folder.is_symlink():
        folder.unlink()
    elif folder.exists():
        shutil.rmtree(folder)
    # In an environment, the interpreter that it was made with.
    python = getattr(sys, "_base_executable", sys.executable)
    subprocess.run([python, "-I", "-m", "venv", folder], check=True)
    pip: list = [folder / "bin" / "python", "-I", "-X", "utf8", "-m", "pip"]
    clean = {name: text for name, text in os.environ.items() if not name.startswith("PIP_")}
    named = {name: "PIP_" + name.upper().replace("-", "_") for name in KEPT}
    # Verbose, lest a quiet pip list nothing.
    listed = subprocess.run(
        [*pip, "-vvv", "config", "list"],
        env=clean | {k: os.environ[k] for k in ["PIP_CONFIG_FILE"] if k in os.environ},
        check=True,
        stdout=subprocess.PIPE,
    ).stdout.decode()
    kept = {"PIP_CONFIG_FILE": os.devnull}
    for section in ("global", "install"):
        for name, text in re.findall(rf"^{section}\.([a-z-]+)=(.*)$", listed, re.M):
            if name in KEPT:
                kept[named[name]] = ast.literal_eval(text)
    kept |= {key: os.environ[key] for key in named.values() if key in os.environ}
    command = ["install", "-q", "--disable-pip-version-check", "--only-binary", ":all:"]
    subprocess.run([*pip, *command, *map(str, what)], env=clean | kept, check=True)


def main(arguments: list) -> None:
    """Build ``.venv``, or an environment in the first argument of the packages after it."""
    if not (3, 11) <= sys.version_info[:2] <= (3, 13):
        version = ".".join(map(str, sys.version_info[:3]))
        sys.exit(f"{sys.executable} is Python {version}, not 3.11 to 3.13: say make PYTHON=...")
    if not all(map(importlib.util.find_spec, ("venv", "ensurepip"))):
        sys.exit(
            f"{sys.executable} lacks its venv module: install it "
            "(Debian and Ubuntu: apt install python3-venv)"
        )
    try:
        if arguments:
            install(Path(arguments[0]), *arguments[1:])
        else:
            build(Path.cwd())
    except subprocess.CalledProcessError as error:
        sys.exit(f"no environment: {' '.join(map(str, error.cmd[-3:]))} failed, see above")
    except OSError as error:
        sys.exit(f"no environment: {error}")
    except KeyboardInterrupt:
        sys.exit("interrupted")


if __name__ == "__main__":
    main(sys.argv[1:])
