// Tells the values under the pointer, in all plots at once.
const svgs = ["position", "error", "velocity", "current"].map((id) => document.getElementById(id)).filter(Boolean);
const texts = {
  position: (row) => `${row[0].toFixed(3)} s: command ${row[1].toFixed(2)}°, feedback ${row[2].toFixed(2)}°`,
  error: (row) => `${row[3].toFixed(4)}°`,
  velocity: (row) => `${row[4].toFixed(1)} 1/min`,
  current: (row) => `${row[5].toFixed(1)} %`,
};
function show(event) {
  const box = event.currentTarget.getBoundingClientRect();
  const x = ((event.clientX - box.left) / box.width) * readings.width;
  const share = (x - readings.left) / (readings.right - readings.left);
  if (share < 0 || share > 1 || readings.rows.length === 0) return hide();
  const time = readings.from + share * (readings.to - readings.from);
  let low = 0, high = readings.rows.length - 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (readings.rows[middle][0] < time) low = middle + 1; else high = middle;
  }
  for (const svg of svgs) {
    const pointer = svg.querySelector(".pointer");
    pointer.setAttribute("transform", `translate(${x.toFixed(1)} 0)`);
    pointer.style.visibility = "visible";
    document.querySelector(`output[for="${svg.id}"]`).textContent = texts[svg.id](readings.rows[low]);
  }
}
function hide() {
  for (const svg of svgs) {
    svg.querySelector(".pointer").style.visibility = "hidden";
    document.querySelector(`output[for="${svg.id}"]`).textContent = "";
  }
}
for (const svg of svgs) {
  svg.addEventListener("pointermove", show);
  svg.addEventListener("pointerleave", hide);
}
