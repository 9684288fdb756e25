"""Use an installation as a new user does, with nothing of Rust in reach: a map, its page, every driver, a rehearsal behind the lab server.

    python3 tests/python/check_installation.py DIRECTORY [ROOT]

DIRECTORY holds the command `mapper`; below ROOT, a system of its own, if that is given (chroot, which needs root).
"""

import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
DRIVERS = {"ak", "modbus", "opcua"}


def main(programs: str, root: str = "/") -> None:
    # The command finds its own directory in /proc.
    isolated = ["unshare", "--mount", "--pid", "--fork", "--kill-child", f"--mount-proc={root}/proc", "chroot", root]
    chroot = [] if root == "/" else isolated
    # The directory of the programs is not on PATH: drivers are found next to the command.
    clean = ["env", "-i", "PATH=/usr/bin:/bin", "PLC_USER=operator", "PLC_PASSWORD=secret"]
    with tempfile.TemporaryDirectory(dir=Path(root) / "tmp") as folder:
        home = "/" + str(Path(folder).relative_to(root))
        for example in ("first_points.yaml", "first_points_opcua.yaml"):
            shutil.copy(REPOSITORY / "examples/rig" / example, folder)

        def command(program: str, *arguments: str) -> list[str]:
            words = " ".join([f"cd {home} && exec {programs}/{program}", *arguments])
            return [*chroot, *clean, f"HOME={home}", "sh", "-c", f"exec 2>&1; {words}"]

        def run(*arguments: str) -> str:
            begun = time.monotonic()
            done = subprocess.run(command("mapper", *arguments), stdout=subprocess.PIPE, text=True, check=False)
            print(f"{time.monotonic() - begun:7.1f} s  mapper {' '.join(arguments)}", flush=True)
            assert done.returncode == 0, done.stdout
            return done.stdout

        rust = subprocess.run([*chroot, *clean, "sh", "-c", "command -v cargo rustc"], check=False)
        assert rust.returncode != 0, "Rust is on PATH, and a driver could have been built"
        run("init", "my_turbo", "--wheel", "60mm")
        run("run", "my_turbo.yaml")
        for name in ("report.html", "map.csv"):
            assert any(Path(folder).rglob(name)), f"no {name} in {sorted(Path(folder).rglob('*'))}"
        listed = json.loads(run("backend", "list", "--json"))["backends"]
        found = {one["name"]: one["program"] for one in listed if "program" in one}
        assert found.keys() >= DRIVERS, found
        run("check", "first_points_opcua.yaml")
        stand = subprocess.Popen(
            command("mapper-lab-server", "first_points.yaml", "--modbus", "127.0.0.1:5020"), stdout=subprocess.PIPE
        )
        try:
            assert stand.stdout is not None
            print(stand.stdout.readline().decode().rstrip())
            run("backend", "check", "modbus", "--campaign", "first_points.yaml")
        finally:
            # unshare does not pass on a request to end.
            stand.kill()
            stand.wait()


main(*sys.argv[1:])
