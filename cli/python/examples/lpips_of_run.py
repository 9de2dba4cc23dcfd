"""LPIPS of the deblurred keyframes against true sharp images (pip install lpips), beside PSNR and SSIM.

    python lpips_of_run.py RUN [SHARP]

SHARP holds NNNNNN.png, named by the index of the frame; the data set of `mba synth` has it.
"""

import sys
from pathlib import Path

import numpy as np

import mba

try:
    import lpips
    import torch
    from PIL import Image
except ImportError as error:
    print(f"skipped: {error} (pip install lpips pillow)")
    sys.exit()


def tensor(image: np.ndarray) -> "torch.Tensor":
    """As LPIPS takes it: channels first, -1 to 1."""
    return torch.from_numpy(image).permute(2, 0, 1)[None].float() / 127.5 - 1.0


def main(folder: str, sharp: str | None) -> None:
    run = mba.Run.open(folder)
    truth = Path(sharp) if sharp else Path(run.summary["dataset"]) / "sharp"
    measure = lpips.LPIPS(net="alex", verbose=False)
    rows = []
    for index, path in run.deblurred.items():
        pair = [np.asarray(Image.open(file).convert("RGB")) for file in (truth / path.name, path)]
        with torch.no_grad():
            distance = float(measure(*map(tensor, pair)))
        rows.append((mba.psnr(*pair), mba.ssim(*pair), distance))
        print(f"{index:6d}  PSNR {rows[-1][0]:.2f} dB  SSIM {rows[-1][1]:.4f}  LPIPS {distance:.4f}")
    print("mean    PSNR {:.2f} dB  SSIM {:.4f}  LPIPS {:.4f}".format(*np.mean(rows, axis=0)))


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("usage: python lpips_of_run.py RUN [SHARP]")
    main(sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else None)
