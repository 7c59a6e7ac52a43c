console.log('viewer');
