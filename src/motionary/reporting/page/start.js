// The page that its content asks for.

const host = document.getElementById("page");
if (content.galleries) new Gallery(host);
else if (content.live) new LivePlayer(host);
else new Player(host);
