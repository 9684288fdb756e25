"""What is installed without Rust: `cargo xtask wheel` and `cargo xtask package` run this script with the tools of release-tools.txt."""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import platform
import shutil
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import with_command

ROOT = Path(__file__).resolve().parents[1]
BUILT = ROOT / os.environ.get("CARGO_TARGET_DIR", "target")
CARGO = os.environ.get("CARGO", "cargo")
TOOLS = Path(sys.executable).parent
CHECK = ROOT / "tests/python/check_installation.py"

# glibc 2.28 is that of Debian 10, Ubuntu 18.10 and RHEL 8, and the oldest that current NumPy wheels support.
GLIBC = "2.28"
COMPATIBILITY = "manylinux_2_28"
TARGETS = {"x86_64": "x86_64-unknown-linux-gnu", "aarch64": "aarch64-unknown-linux-gnu"}
# Where each shell finds completions, below /usr.
COMPLETIONS = {
    "bash": "share/bash-completion/completions/mapper",
    "fish": "share/fish/vendor_completions.d/mapper.fish",
    "zsh": "share/zsh/vendor-completions/_mapper",
}
LICENCES = ("LICEN", "COPYING", "NOTICE", "UNLICEN")
# The oldest Debian that is still on the mirrors: glibc 2.31.
DEBIAN = "bullseye"


def run(*words: object, **environment: str) -> None:
    """Run a command in the root of the repository, the tools first on PATH."""
    line = [str(word) for word in words]
    print("$", *line, flush=True)
    path = f"{TOOLS}{os.pathsep}{os.environ['PATH']}"
    subprocess.run(line, cwd=ROOT, check=True, env={**os.environ, "PATH": path, **environment})


def output(*words: object) -> str:
    """Return what a command prints."""
    line = [str(word) for word in words]
    return subprocess.run(line, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout


def building(target: str) -> dict[str, str]:
    """Return the variables that let cargo, and so maturin and with_command.py, build for a target by zig's linker."""
    triple = TARGETS[target]
    if target != platform.machine():
        run("rustup", "target", "add", triple)
    # cargo-zigbuild sets them and starts cargo. maturin's own `--zig` would set others, and build every library again.
    with tempfile.TemporaryDirectory() as folder:
        cargo = Path(folder, "cargo")
        cargo.write_text("#!/bin/sh\nexec env -0\n")
        cargo.chmod(0o700)
        path = f"{TOOLS}{os.pathsep}{os.environ['PATH']}"
        begun = {**os.environ, "PATH": path, "CARGO": str(cargo)}
        words = ["cargo-zigbuild", "zigbuild", "--release", "--target", f"{triple}.{GLIBC}"]
        listed = subprocess.run(words, env=begun, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    variables = dict(entry.split("=", 1) for entry in listed.split("\0") if entry)
    maturin = f"--compatibility {COMPATIBILITY}"
    return {**variables, "CARGO": CARGO, "CARGO_BUILD_TARGET": triple, "MATURIN_PEP517_ARGS": maturin}


def source(_target: str) -> None:
    """Check that the source package has its build backend and all manifests, without building it."""
    folder = BUILT / "source-package"
    shutil.rmtree(folder, ignore_errors=True)
    run("maturin", "sdist", "--out", folder)
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--dry-run", "--no-deps", "--no-build-isolation"]
    run(*pip, *folder.iterdir())


def wheel(target: str) -> None:
    """Build the wheel, audit it, and use it in an empty environment if it is for this computer."""
    folder = BUILT / "wheels" / target
    shutil.rmtree(folder, ignore_errors=True)
    pip = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--wheel-dir"]
    run(*pip, folder, ".", **building(target))
    (made,) = folder.iterdir()
    # Of every library and program in the wheel: no later symbols of glibc, and no libraries that a system may lack.
    report = " ".join(output(sys.executable, "-m", "auditwheel", "show", made).split())
    print(report)
    assert f'platform tag: "{COMPATIBILITY}_{target}"' in report, "it needs a later system than it should"
    if target == platform.machine():
        run("maturin", "sdist", "--out", folder)
        use_wheel(made)
    print(*sorted(folder.iterdir()), sep="\n")


def use_wheel(made: Path) -> None:
    """Use a wheel in an empty environment, and run the tests of the package there."""
    home = BUILT / "wheel-env"
    run("python3", "-m", "venv", "--clear", home)
    python = home / "bin/python"
    run(python, "-m", "pip", "install", "--quiet", f"{made}[test]")
    run(python, CHECK, home / "bin")
    tests = [python, "-m", "pytest", "--quiet", "-p", "no:cacheprovider"]
    run(*tests, MAPPER_TEST_PROGRAM=str(home / "bin/mapper"), MPLBACKEND="agg")


def package(target: str) -> None:
    """Build the archive and the Debian package from the same files, and use both."""
    triple = TARGETS[target]
    run(sys.executable, "python/with_command.py", **building(target))
    # Below the directory that cargo-deb takes files from.
    files = BUILT / triple / "release/package"
    shutil.rmtree(files, ignore_errors=True)
    fill(files, triple)
    folder = BUILT / "packages"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    (version,) = {one["version"] for one in metadata(triple) if one["name"] == "mapper-cli"}
    name = f"mapper-{version}-{target}-linux"
    with tarfile.open(folder / f"{name}.tar.gz", "w:gz") as archive:
        archive.add(files, name, filter=owned_by_nobody)
    deb = [CARGO, "deb", "--locked", "-p", "mapper-cli", "--no-build", "--no-strip", "--target", triple]
    run(*deb, "--output", folder)
    sums = [f"{hashlib.sha256(one.read_bytes()).hexdigest()}  {one.name}\n" for one in sorted(folder.iterdir())]
    (folder / f"{name}.sha256").write_text("".join(sums))
    if target == platform.machine():
        use_packages(folder, name)
    print(*sorted(folder.iterdir()), sep="\n")


def owned_by_nobody(entry: tarfile.TarInfo) -> tarfile.TarInfo:
    """Leave out who built an archive, and when."""
    entry.uid = entry.gid = entry.mtime = 0
    entry.uname = entry.gname = ""
    return entry


def metadata(triple: str) -> list[dict[str, Any]]:
    """Return the packages that programs for a target may be built from."""
    options = ["--locked", "--format-version", "1", "--filter-platform", triple]
    packages: list[dict[str, Any]] = json.loads(output(CARGO, "metadata", *options))["packages"]
    return packages


def fill(files: Path, triple: str) -> None:
    """Lay out an installation, in the directories below /usr."""
    shutil.copytree(with_command.SCRIPTS, files / "bin")
    for shell, place in COMPLETIONS.items():
        (files / place).parent.mkdir(parents=True)
        (files / place).write_text(output(files / "bin/mapper", "completions", shell))
    output(files / "bin/mapper", "man", "--out", files / "share/man/man1")
    documents = files / "share/doc/mapper"
    for name in output("git", "ls-files", "campaigns", "examples").split("\n")[:-1]:
        copy(ROOT / name, files / "share/mapper" / name)
    for name in ("LICENSE-APACHE", "LICENSE-MIT", "CHANGELOG.md"):
        copy(ROOT / name, documents / name)
    features = ["--features", "hdf5,parquet,tdms", "--spec-version", "1.5"]
    run(CARGO, "cyclonedx", "--format", "json", "--no-build-deps", "--target", triple, *features, "--quiet")
    for one in metadata(triple):
        home = Path(one["manifest_path"]).parent
        if one["source"] is None:
            bill = home / f"{one['name']}.cdx.json"
            if one["name"] in with_command.COMMAND + with_command.DRIVERS:
                # References to packages of the workspace are paths of this computer.
                (documents / bill.name).write_text(bill.read_text().replace(f"{ROOT}/", ""))
            bill.unlink()
            continue
        for licence in home.iterdir():
            if licence.is_file() and licence.name.upper().startswith(LICENCES):
                copy(licence, documents / "licences" / f"{one['name']}-{one['version']}" / licence.name)


def copy(source: Path, destination: Path) -> None:
    """Copy a file into a new directory if necessary."""
    destination.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, destination)


def use_packages(folder: Path, name: str) -> None:
    """Use the archive where it is unpacked, and the package in a Debian of its own, which needs root."""
    unpacked = BUILT / "unpacked"
    shutil.rmtree(unpacked, ignore_errors=True)
    shutil.unpack_archive(folder / f"{name}.tar.gz", unpacked)
    run(sys.executable, CHECK, unpacked / name / "bin")
    (deb,) = folder.glob("*.deb")
    if os.geteuid() != 0:
        print("LEFT OUT: the Debian package in a system of its own, which needs root, debootstrap and unshare")
        return
    root = BUILT / "debian"
    if not (root / "made").exists():
        run("debootstrap", "--variant=minbase", DEBIAN, root)
        (root / "made").touch()
    shutil.copy(deb, root / "tmp/mapper.deb")
    dpkg = ["chroot", root, "dpkg"]
    run(*dpkg, "--install", "/tmp/mapper.deb")
    run(sys.executable, CHECK, "/usr/bin", root)
    listed = output(*dpkg, "--listfiles", "mapper").split()
    installed = [root / name[1:] for name in listed if "mapper" in name]
    assert all(file.exists() for file in installed), installed
    assert {"/usr/lib/systemd/system/mapper-nightly.service", "/usr/lib/systemd/system/mapper-nightly.timer"} <= {
        *listed
    }
    run(*dpkg, "--purge", "mapper")
    left = [file for file in installed if file.exists()]
    assert not left, left


def main(arguments: Sequence[str] | None = None) -> None:
    """Read the arguments."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["source", "wheel", "package"])
    parser.add_argument("--target", choices=TARGETS, default=platform.machine())
    options = parser.parse_args(arguments)
    {"source": source, "wheel": wheel, "package": package}[options.what](options.target)


main()
