addEventListener('load', () => {
  const wrong = [];
  const root = document.documentElement;
  const width = root.clientWidth;
  if (root.scrollWidth > width) wrong.push(`the page is ${root.scrollWidth} wide in ${width}`);
  const channel = x => (x /= 255) <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4;
  const luminance = color => {
    const [r, g, b] = color.match(/[\d.]+/g).slice(0, 3).map(Number).map(channel);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const paper = luminance(getComputedStyle(document.body).backgroundColor);
  const faint = (color, least) => {
    const ink = luminance(color);
    return (Math.max(ink, paper) + 0.05) / (Math.min(ink, paper) + 0.05) < least;
  };
  for (const element of document.querySelectorAll('h1,h2,h3,p,li,a,code,figcaption,th,td')) {
    const box = element.getBoundingClientRect();
    const text = element.textContent.slice(0, 60);
    if (faint(getComputedStyle(element).color, 4.5)) wrong.push(`too little contrast: ${text}`);
    // Tables scroll in a box of their own.
    if (!element.closest('.scroll') && (box.right > width + 0.5 || box.left < -0.5)) wrong.push(`too wide: ${text}`);
  }
  for (const scroll of document.querySelectorAll('.scroll')) {
    const box = scroll.getBoundingClientRect();
    if (box.right > width + 0.5) wrong.push('a table is too wide');
  }
  for (const figure of document.querySelectorAll('figure')) {
    const title = figure.querySelector('figcaption').textContent;
    const shown = [...figure.querySelectorAll('svg')].filter(svg => svg.getBoundingClientRect().width > 0);
    if (shown.length !== 1) { wrong.push(`${shown.length} drawings of ${title}`); continue; }
    const frame = shown[0].getBoundingClientRect();
    const points = shown[0].querySelectorAll('circle');
    if (points.length !== Number(figure.dataset.points)) wrong.push(`${points.length} points of ${title}`);
    for (const part of shown[0].querySelectorAll('text,circle')) {
      const box = part.getBoundingClientRect();
      const name = `${part.textContent || 'a point'} of ${title}`;
      const isOut = box.left < frame.left - 1 || box.right > frame.right + 1 || box.top < frame.top - 1 || box.bottom > frame.bottom + 1;
      const style = getComputedStyle(part);
      // A stated length stretches the box of small text, so its font is measured.
      if (part.tagName === 'text' && parseFloat(style.fontSize) < 8) wrong.push(`too small to read: ${name}`);
      if (isOut) wrong.push(`outside its plot: ${name}`);
      const color = part.tagName === 'circle' && style.fill === 'none' ? style.stroke : style.fill;
      if (faint(color, part.tagName === 'text' ? 4.5 : 3)) wrong.push(`too little contrast: ${name}`);
    }
  }
  parent.postMessage(wrong.length ? wrong.slice(0, 20).join('; ') : `${document.querySelectorAll('figure').length} figures: nothing wrong`, '*');
});
