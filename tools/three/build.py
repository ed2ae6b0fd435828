"""Build the one script of three.js that pages carry, and record what it is.

Needs Node.js and npm: `python tools/three/build.py` installs the versions that package.json
names into a temporary folder, bundles what entry.js names, and writes the script, its licence
and three.toml (versions, size, SHA-256) into the package. With `--check` nothing is written,
and the exit code says whether the script in the package is what these versions give.
"""

import hashlib
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
PAGE = HERE.parents[1] / "src" / "motionary" / "reporting" / "page"
MOST_BYTES = 700_000


def bundle(folder: Path) -> bytes:
    """The script, built in a folder."""
    for name in ("package.json", "entry.js"):
        shutil.copy(HERE / name, folder)
    npm = shutil.which("npm") or "npm"
    subprocess.run([npm, "install", "--no-audit", "--no-fund", "--no-package-lock"],
                   cwd=folder, check=True, stdout=sys.stderr)  # fmt: skip
    command = [
        shutil.which("esbuild", path=str(folder / "node_modules" / ".bin")) or "esbuild",
        "entry.js", "--bundle", "--minify", "--format=iife", "--global-name=THREE",
        "--target=es2020", "--legal-comments=inline", "--outfile=three.min.js",
    ]  # fmt: skip
    subprocess.run(command, cwd=folder, check=True, stdout=sys.stderr)
    return (folder / "three.min.js").read_bytes()


def main() -> int:
    """Build, then write or compare."""
    versions = json.loads((HERE / "package.json").read_text("utf-8"))
    with tempfile.TemporaryDirectory() as name:
        script = bundle(Path(name))
        licence = (Path(name) / "node_modules/three/LICENSE").read_bytes()
    if len(script) > MOST_BYTES:
        sys.exit(f"three.min.js has {len(script)} bytes, more than {MOST_BYTES}")
    record = (
        "# Written by tools/three/build.py\n"
        f'three = "{versions["dependencies"]["three"]}"\n'
        f'esbuild = "{versions["devDependencies"]["esbuild"]}"\n'
        'licence = "MIT"\n'
        f"bytes = {len(script)}\n"
        f'sha256 = "{hashlib.sha256(script).hexdigest()}"\n'
    )
    if "--check" in sys.argv:
        return int((PAGE / "three.min.js").read_bytes() != script)
    (PAGE / "three.min.js").write_bytes(script)
    (PAGE / "three.LICENSE").write_bytes(licence)
    (PAGE / "three.toml").write_text(record, "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
